// SPDX-License-Identifier: Apache-2.0
// Which cells can matter to light, and how far a ray may jump where none does.
#pragma once

#include <cstdint>
#include <vector>

#include "core/simd/kernels.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Occupied cells of a field, as the marching kernel reads them.
struct Occupancy {
    std::vector<LeafMask> cells;            // [leaf], a subset of topology.cells()
    LeafTable skip;                         // see Bricks::skip_nodes

    std::size_t cellCount() const;
    std::size_t leafCount() const;  // leaves with at least one occupied cell
};

/// Raw density at which light crossing one voxel loses `alpha` of itself.
float rawFromVoxelAlpha(const VoxelField& field, float alpha);

/// A cell is occupied if it exists and light crossing one voxel at the density of its densest corner loses at
/// least `min_alpha`. Trilinear values never exceed the corners, so a cell that is not occupied stops less.
Occupancy findOccupied(const VoxelField& field, float min_alpha);

/// Occupancy from given cells: fills the skip table: Chebyshev distances to the nearest leaf that has any,
/// exact to 9 leaves, and to the nearest node that has any.
Occupancy occupancyFromCells(const Topology& topology, std::vector<LeafMask> cells);

/// The kernels' view of a field and its occupied cells; borrows both.
Bricks bricksOf(const VoxelField& field, const Occupancy& occupancy);
/// The same of a topology; values are left to the caller.
Bricks bricksOf(const Topology& topology, const Occupancy& occupancy);

}  // namespace nerfvdb
