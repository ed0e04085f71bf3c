// SPDX-License-Identifier: Apache-2.0
#include "export/placement.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// Written out, so that what was 0 or 1 stays exactly that.
Mat3d turned(UpAxis from, UpAxis to) {
    if (from == to) return Mat3d::Identity();
    Mat3d y_from_z;
    y_from_z << 1, 0, 0,  //
        0, 0, 1,          //
        0, -1, 0;
    return from == UpAxis::z ? y_from_z : Mat3d(y_from_z.transpose());
}

}  // namespace

Similarity placementOf(const PlacementOptions& options, const Box& bounds) {
    if (!std::isfinite(options.scale) || !(options.scale > 0))
        throw UsageError("--scale", std::to_string(options.scale), "a positive number");
    const UpAxis up = options.up.value_or(options.source_up);
    Similarity placement;
    placement.scale = options.scale;
    placement.rotation = turned(options.source_up, up);
    if (options.origin == PlacementOptions::Origin::keep) return placement;

    if (!bounds.min.allFinite() || !bounds.max.allFinite() || (bounds.min.array() > bounds.max.array()).any())
        throw UsageError("--center", "bounds that are none", "a scene that occupies some space");
    const Vec3d corner = placement.apply(bounds.min), opposite = placement.apply(bounds.max);
    placement.translation = -0.5 * (corner + opposite);
    if (options.origin == PlacementOptions::Origin::ground) {
        const int axis = up == UpAxis::y ? 1 : 2;
        placement.translation[axis] = -std::min(corner[axis], opposite[axis]);
    }
    return placement;
}

}  // namespace nerfvdb
