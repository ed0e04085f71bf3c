// SPDX-License-Identifier: Apache-2.0
// Where an edge between two voxels crosses the surface, and how the surface is turned there.
#pragma once

#include "export/surface_cells.h"

namespace nerfvdb {

// Crossings keep this share of an edge away from its ends, so that no two vertices meet at a voxel: a
// thousandth of a voxel, far below what it resolves and above the rounding of float positions.
inline constexpr float kOffCorner = 0x1p-10f;

struct SurfacePoint {
    Vec3f position;  // voxels from the block's first voxel
    Vec3f normal;    // unit, towards falling density
};

/// The crossed edges of one block.
class BlockCrossings {
public:
    BlockCrossings(const Surface& surface, const Vec3i& leaf);

    /// On the edge from voxel (x, y, z) of the block along `axis`, which must cross the surface: where the raw
    /// density, linear along it, is iso. An edge that leaves the surface's bounds crosses at them, kOffCorner
    /// beyond.
    SurfacePoint at(int x, int y, int z, int axis) const;

private:
    bool isInBounds(const Vec3i& voxel) const { return bounds_.contains(voxel); }

    BlockValues values_;
    float iso_;
    VoxelBox bounds_;  // from the block's first voxel
    bool is_cut_;      // the bounds end within the block's cells
};

}  // namespace nerfvdb
