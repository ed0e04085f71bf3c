// SPDX-License-Identifier: Apache-2.0
// A lamp post: thin enough to vanish at coarse voxels. It stands at the origin, z up; its arm reaches along +y.
#pragma once

#include "trainer/signed_distance.h"

namespace nerfvdb {

/// Symmetric in x, so that the nearest of a row of posts is the one whose x is nearest.
inline double lampPostDistance(const Vec3d& p) {
    constexpr double kHeight = 5.0, kRadius = 0.06, kArm = 1.4;
    const double pole = std::max(length(p.x(), p.y()) - kRadius, p.z() - kHeight);
    const double foot = std::max(length(p.x(), p.y()) - 2.5 * kRadius, p.z() - 0.5);
    const double arm = (p - Vec3d(0, std::clamp(p.y(), 0.0, kArm), kHeight)).norm() - 0.7 * kRadius;
    const double lamp = ballDistance(p - Vec3d(0, kArm, kHeight - 0.1), 0.18);
    return std::min({pole, foot, arm, lamp});
}

inline Vec3d lampPostAlbedo(const Vec3d& p) {
    const bool is_lamp = p.y() > 1.1;
    return is_lamp ? Vec3d(0.93, 0.90, 0.80) : Vec3d(0.16, 0.20, 0.18);
}

}  // namespace nerfvdb
