// SPDX-License-Identifier: Apache-2.0
// The small vocabulary that every folder shares: vectors, boxes, spans.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

namespace nerfvdb {

using Vec2d = Eigen::Vector2d;
using Vec3d = Eigen::Vector3d;
using Vec3f = Eigen::Vector3f;
using Vec3i = Eigen::Vector3i;
using Mat3d = Eigen::Matrix3d;

/// Axis-aligned box in world units, min <= max on every axis.
struct Box {
    Vec3d min = Vec3d::Zero();
    Vec3d max = Vec3d::Zero();

    Vec3d size() const { return max - min; }
    Vec3d center() const { return 0.5 * (min + max); }
    bool contains(const Vec3d& p) const {
        return (p.array() >= min.array()).all() && (p.array() <= max.array()).all();
    }
};

}  // namespace nerfvdb
