// SPDX-License-Identifier: Apache-2.0
// Grids over a scene's box, and in shells around it.
#pragma once

#include "core/types.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// A grid over a box: the frame, and voxels per axis (multiples of 8). The longest side has `resolution` voxels.
struct BoxGrid {
    GridFrame frame;
    Vec3i dims;
    Shells shells;
};
BoxGrid gridOver(const Box& box, int resolution);
/// The same by the edge of a voxel, world units.
BoxGrid gridOfVoxels(const Box& box, double voxel_size);
/// A grid in `shells` shells around the box, shell 0 of the given voxels; sides are rounded up to 8 cells.
BoxGrid gridAround(const Box& box, double voxel_size, int shells);

}  // namespace nerfvdb
