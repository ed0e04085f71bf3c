// SPDX-License-Identifier: Apache-2.0
#include "export/surface_crossing.h"

#include <algorithm>

namespace nerfvdb {
namespace {

/// Slope of the raw density at a voxel along an axis, per voxel. `is_known_only`: differences with voxels that
/// hold nothing are left out: their kEmptyRaw tells where the known region ends, not how the surface is turned.
/// Differences with filled voxels, whose density means nothing, are always left out.
float slopeAt(const float* value, int axis, bool is_known_only) {
    const float below = value[-BlockValues::kStride[axis]], above = value[BlockValues::kStride[axis]];
    const bool use_below = below != kFilledRaw && (!is_known_only || below != kEmptyRaw);
    const bool use_above = above != kFilledRaw && (!is_known_only || above != kEmptyRaw);
    const float sum = (use_above ? above - *value : 0) + (use_below ? *value - below : 0);
    return use_above && use_below ? 0.5f * sum : sum;
}

}  // namespace

BlockCrossings::BlockCrossings(const Surface& surface, const Vec3i& leaf)
    : values_(surface, leaf), iso_(surface.iso), bounds_(surface.bounds) {
    bounds_.min -= leaf * kLeafDim;
    bounds_.max -= leaf * kLeafDim;
    is_cut_ = !isInBounds(Vec3i::Zero()) || !isInBounds(Vec3i::Constant(kLeafDim));
}

SurfacePoint BlockCrossings::at(int x, int y, int z, int axis) const {
    SurfacePoint point{Vec3f(x, y, z), Vec3f::Zero()};
    if (is_cut_) {
        const Vec3i voxel(x, y, z);
        const bool is_upper_face = !isInBounds(voxel + Vec3i::Unit(axis));
        if (is_upper_face || !isInBounds(voxel)) {
            point.position[axis] += is_upper_face ? kOffCorner : 1 - kOffCorner;
            point.normal[axis] = is_upper_face ? 1.0f : -1.0f;
            return point;
        }
    }
    const float* low = values_.at(x, y, z);
    const float* high = low + BlockValues::kStride[axis];
    const float t = std::clamp((iso_ - *low) / (*high - *low), kOffCorner, 1 - kOffCorner);
    point.position[axis] += t;

    // Central differences at both voxels, linear between them: second order, unlike the trilinear field's own
    // slope, which jumps from cell to cell. On an edge that leaves the known region the surface is the region's
    // border: there, the voxel inside decides, and what holds nothing counts.
    const bool is_border = *low == kEmptyRaw || *high == kEmptyRaw;
    Vec3f slope;
    for (int a = 0; a < 3; ++a)
        slope[a] = is_border ? slopeAt(*low < *high ? high : low, a, false)
                             : (1 - t) * slopeAt(low, a, true) + t * slopeAt(high, a, true);
    // The edge itself says which way is out; differences over two voxels can miss that on thin sheets.
    const float along = *high - *low;
    if (slope[axis] * along <= 0) slope[axis] = along;
    point.normal = -slope.normalized();
    return point;
}

}  // namespace nerfvdb
