// SPDX-License-Identifier: Apache-2.0
#include "export/moved_model.h"

#include <utility>

namespace nerfvdb {

Model movedModel(Model model, const Vec3d& origin) {
    if (origin.isZero(0)) return model;
    VoxelField& field = model.field;
    GridFrame frame = field.frame();
    frame.origin -= origin;
    HugeArray<float> density = field.takeDensity(), features = field.takeFeatures();
    field = VoxelField(Topology(field.topology()), frame, Shells(field.shells()), field.channels(), field.densityScale(),
                       std::move(density), std::move(features));
    for (ModelCamera& camera : model.cameras) camera.camera.position -= origin;
    return model;
}

}  // namespace nerfvdb
