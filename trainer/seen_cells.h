// SPDX-License-Identifier: Apache-2.0
// Which cells the photographs see. Training notes it of the rays that it draws; a short one draws too few to meet every
// cell, and what no ray met would be taken for unseen. So the photographs are looked through once more before cells that
// nothing saw are given up.
#pragma once

#include <vector>

#include "trainer/dataset.h"
#include "vdb/occupancy.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Pixels between rays that still meet every voxel of the inner box, wherever in it a camera stands: what a voxel spans at
/// the far end of the box's diagonal, at least 1. Voxels of outer shells are as much larger as they are further away;
/// those that are halved (resolvedRegions) are wider than a pixel of what stands so near.
int strideOfLooks(const Dataset& dataset, const VoxelField& field);

/// Sets, in `seen` [leaf], the bits of cells that give a ray at least `min_seen` of its light, of a ray through every
/// stride-th pixel of every stride-th row that counts. The same for any number of threads.
void markSeenCells(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy, float min_seen, int stride,
                   std::vector<LeafMask>& seen);

}  // namespace nerfvdb
