// SPDX-License-Identifier: Apache-2.0
// From one world to another in which everything is turned, moved and of another size, but not bent.
#pragma once

#include "core/camera.h"
#include "core/types.h"

namespace nerfvdb {

/// The axis of a world that points up. Photographs' worlds have z (NeRF-synthetic, instant-ngp, nerfstudio), and so has
/// Blender; Houdini, Maya, Unity and glTF have y.
enum class UpAxis { y, z };

/// to = scale * rotation * from + translation. `rotation` is orthonormal with determinant 1; scale > 0.
struct Similarity {
    double scale = 1.0;
    Mat3d rotation = Mat3d::Identity();
    Vec3d translation = Vec3d::Zero();

    Vec3d apply(const Vec3d& from) const { return scale * (rotation * from) + translation; }
    Similarity inverse() const {
        return {1 / scale, rotation.transpose(), rotation.transpose() * -translation / scale};
    }
    /// The camera that sees the world `to` as the given one sees `from`: the same pictures, distances times scale.
    Camera apply(Camera camera) const {
        camera.world_from_camera = rotation * camera.world_from_camera;
        camera.position = apply(camera.position);
        return camera;
    }
};

}  // namespace nerfvdb
