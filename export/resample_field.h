// SPDX-License-Identifier: Apache-2.0
// The field of a surface on another lattice, coarser or finer, so that the surface comes out in larger or
// smaller triangles.
#pragma once

#include "export/surface_cells.h"

namespace nerfvdb {

/// A field that, cut at surface.iso, has the same surface on voxels of `voxel_size` (world units, larger than
/// the field's own): each coarse voxel knows which share of the space around it is inside, through a tent
/// filter one coarse voxel wide to either side, so that nothing is missed between voxels and no staircase
/// remains. Shares are exact along one axis and taken at 4 x 4 places across it, of the field as surfaces see
/// it: trilinear in raw density, kEmptyRaw where nothing is known, and full where it was filled.
///
/// Values: raw density such that a plane stays where it was: a distance from the surface in coarse voxels, from
/// what a tent sees of a half space (share s: sqrt(2 s) - 1 below one half, 1 - sqrt(2 - 2 s) above), scaled so
/// that what is empty holds kEmptyRaw. Walls thinner than about half a coarse voxel vanish. With features:
/// their mean under the same filter, of voxels inside; of all active ones where none is. Cost: time follows the
/// active voxels of both fields; memory those of the result and 2 KB for each leaf. Threads: results are the
/// same for any number.
VoxelField coarserField(const Surface& surface, double voxel_size, bool with_features);

/// A field without features on voxels of `voxel_size`, smaller than the field's own: raw density by trilinear
/// interpolation, in all cells that have a corner inside. It holds nothing else: time and memory follow these.
/// What was filled is not: fill the finer surface. Threads: results are the same for any number.
VoxelField finerField(const Surface& surface, double voxel_size);

}  // namespace nerfvdb
