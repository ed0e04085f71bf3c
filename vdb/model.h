// SPDX-License-Identifier: Apache-2.0
// A trained scene: everything that rendering, export and meshing need, and nothing that only training needs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/types.h"
#include "vdb/decoder.h"
#include "vdb/sky.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// What a model says of its own making; no clock, path or thread count, so that equal training gives equal files.
struct ModelInfo {
    std::string schedule;       // steps per stage, such as "120,300,900,2400": what --steps takes, with a preset of
                                // as many features and as wide a network
    std::uint64_t seed = 0;
    double train_psnr = 0;      // running mean at the end, dB
};

/// A place from which the scene was photographed. Exports are judged from there, and artists line up their plates.
struct ModelCamera {
    std::string name;       // of the photograph, relative to its data set
    Camera camera;
    bool held_out = false;  // not trained on
};

struct Model {
    VoxelField field;
    Decoder decoder;
    Vec3f background = Vec3f::Ones();  // sRGB values behind the scene ...
    Sky sky;                           // ... unless it has a sky
    ModelInfo info;
    std::vector<ModelCamera> cameras;  // in the data set's order, held-out ones last; empty if nobody told
};

/// Those that the model was trained from, or those that were held out.
inline std::vector<Camera> camerasOf(const Model& model, bool held_out) {
    std::vector<Camera> cameras;
    for (const ModelCamera& camera : model.cameras)
        if (camera.held_out == held_out) cameras.push_back(camera.camera);
    return cameras;
}

}  // namespace nerfvdb
