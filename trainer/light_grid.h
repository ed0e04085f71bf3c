// SPDX-License-Identifier: Apache-2.0
// Shadow and ambient occlusion of a solid scene, baked once so that asking for its colour stays cheap.
#pragma once

#include <vector>

#include "trainer/solid_scene.h"

namespace nerfvdb {

/// What light reaches places near the surfaces. Values on a coarse grid, trilinear between; this reading is
/// part of the scene's definition, hence as exact as the rest, and it softens shadows.
class LightGrid {
public:
    struct Light {
        double sun = 0.0;  // share of the sun that is not hidden, in [0, 1]
        double sky = 0.0;  // share of the sky that is open, in [0, 1]
    };

    /// Bakes the whole box in parallel. The scene is not kept.
    explicit LightGrid(const SolidScene& scene);
    Light at(const Vec3d& point) const;

private:
    std::size_t offset(const Vec3i& c) const {
        return (static_cast<std::size_t>(c.z()) * dims_.y() + c.y()) * dims_.x() + c.x();
    }
    template <typename Body>
    void forEachCorner(const Body& body);
    void smooth(int axis);

    Vec3d origin_;
    Vec3i dims_;
    std::vector<Light> lights_;  // [z][y][x]
};

}  // namespace nerfvdb
