// SPDX-License-Identifier: Apache-2.0
// The shell of shell_model.h, with cameras around it, as after training.
#pragma once

#include "tests/support/shell_model.h"

namespace nerfvdb::test {

/// `n` voxels a side; six cameras that it trained from, and two that it did not, of `pixels` a side.
inline Model seenModel(int n = 32, int pixels = 48) {
    Model model = shellModel(n);
    const Vec3d centre = model.field.worldBox().center();
    for (int i = 0; i < 8; ++i) {
        const double angle = 0.8 * i;
        const Vec3d eye = centre + Vec3d(3.2 * std::cos(angle), 3.2 * std::sin(angle), i % 2 ? 1.6 : -1.2);
        model.cameras.push_back({"view_" + std::to_string(i) + ".png",
                                 lookAt(eye, centre, Vec3d::UnitZ(), 0.75, pixels, pixels), i >= 6});
    }
    return model;
}

inline std::vector<Camera> trainingCameras(const Model& model) { return camerasOf(model, /*held_out=*/false); }

}  // namespace nerfvdb::test
