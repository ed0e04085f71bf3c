// SPDX-License-Identifier: Apache-2.0
// Opaque bodies made solid. No camera sees the inside of one, so training leaves soft holes there, and marching
// cubes would draw them: what the outside cannot reach counts as inside.
#pragma once

#include <cstddef>

#include "export/surface_cells.h"

namespace nerfvdb {

/// Adds to the inside every voxel below iso from which no path of voxels below iso leads out of the box,
/// whether it is known or not: leaves that are absent among them (Surface::enclosed). Returns how many.
///
/// A path goes from a voxel to its six face neighbours. So every neighbour of an added voxel is inside, too: no
/// crossed edge ends at one, no ambiguous face has one for a corner, and what remains of the surface are
/// exactly the crossings between known inside and open outside, where they were. A path over edges or corners
/// would call cavities open that the surface, which follows edges, closes off, and their sheets would remain.
/// The reverse is that a leak only as wide as the diagonal of a face is stopped up.
///
/// Cost: time and memory follow the leaves, and one bit for each of the box's 8^3 blocks.
/// Source: flood fill from the border, a leaf at a time, 64 voxels in each word.
std::size_t fillInside(Surface& surface);

}  // namespace nerfvdb
