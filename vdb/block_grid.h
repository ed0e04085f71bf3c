// SPDX-License-Identifier: Apache-2.0
// A scene in blocks: boxes side by side over its ground, each with a field, shells and a sky of its own, trained from
// the photographs taken in it. Neighbours overlap, so that a camera between two is well inside both, and fade into each
// other along the overlap. Source: Tancik et al. 2022, "Block-NeRF", section 4 (there, circles around crossings).
//
// All blocks have the same size and stand on one lattice of coarsest voxels, so that their voxels coincide at every
// level and can be put together again:
//
//     |----------- core -----------|                      a block's own part; the cores tile the region
//   --|----------------------------|--                    box: core and margins; what the block learns
//    /|------------ 1 -------------|\                     weight: fades kFade voxels to either side of the border
#pragma once

#include <vector>

#include "core/types.h"

namespace nerfvdb {

/// Which block: 0, 1, ... along the two axes of the ground, in the order x, y, z.
struct BlockId {
    int i = 0, j = 0;
    bool operator==(const BlockId&) const = default;
};

/// How a region is cut. Lengths count in coarsest voxels, one of which is `voxel_size` world units.
struct BlockGrid {
    static constexpr int kResolution = 64;  // voxels along a box's longest side, at most
    static constexpr int kMargin = 12;      // that a box goes beyond its core where it has a neighbour
    static constexpr int kFade = 4;         // to either side of a border

    Vec3d origin = Vec3d::Zero();  // lowest corner of the region, world units
    double voxel_size = 1;
    Vec3i core = Vec3i::Constant(kResolution);  // multiples of 8
    int columns = 1, rows = 1;                  // of blocks: i < columns, j < rows
    int up = 2;                                 // the axis that is not cut

    bool operator==(const BlockGrid&) const = default;

    int axisOfColumns() const { return up == 0 ? 1 : 0; }
    int axisOfRows() const { return up == 2 ? 1 : 2; }
    int countAlong(int axis) const { return axis == up ? 1 : axis == axisOfColumns() ? columns : rows; }
    int numberAlong(const BlockId& block, int axis) const {
        return axis == up ? 0 : axis == axisOfColumns() ? block.i : block.j;
    }
    /// Of a box around its core, voxels.
    Vec3i margin() const;
    /// All blocks, by columns.
    std::vector<BlockId> blocks() const;
    bool has(const BlockId& block) const {
        return block.i >= 0 && block.j >= 0 && block.i < columns && block.j < rows;
    }
    /// Lowest corner of a block's core, and of its box, from the region's lowest corner, voxels.
    Vec3i coreCorner(const BlockId& block) const;
    Vec3i boxCorner(const BlockId& block) const { return coreCorner(block) - margin(); }
    /// In world units.
    Box coreBox(const BlockId& block) const;
    Box box(const BlockId& block) const;
    Box region() const;

    /// The block's share of what is seen from, or stands at, a place: from 0 to 1, and 1 for all blocks together. Beyond the
    /// region as at its nearest place; up does not count.
    double weight(const BlockId& block, const Vec3d& world) const;
    /// Whether the block learns from a camera there: one within its box, or, of a block at the border of the region,
    /// beyond that. Up does not count.
    bool takesCameraAt(const BlockId& block, const Vec3d& world) const;
};

/// Cuts a region (world units), which grows around its centre to whole voxels. Throws UsageError for no blocks or more than
/// kMostBlocks along an axis, or a region that is empty or not finite.
inline constexpr int kMostBlocks = 256;
BlockGrid cutIntoBlocks(const Box& region, int up, int columns, int rows);

}  // namespace nerfvdb
