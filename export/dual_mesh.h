// SPDX-License-Identifier: Apache-2.0
// The surface by OpenVDB's volumeToMesh: a second opinion, and larger faces where it is flat.
#pragma once

#include "export/mesh.h"
#include "export/surface_cells.h"

namespace nerfvdb {

/// The surface with a vertex inside of each cell that it runs through, where the crossings of the cell's edges
/// would have it, and a quad around each crossed edge, split along its shorter diagonal. `adaptivity` in [0, 1]
/// merges cells where the surface is flat: 0 merges none. The same values as extractSurface reads, cut at the
/// same density; normals are the mean of the faces' around a vertex by area.
///
/// Unlike marching cubes it promises neither manifold edges nor vertices: measureMesh says how it turned out.
/// Bounds are rounded off by up to a voxel. Source: Ju et al. 2002, "Dual contouring of Hermite data";
/// OpenVDB's tools/VolumeToMesh.h. Threads: results are the same for any number.
Mesh dualSurface(const Surface& surface, double adaptivity);

}  // namespace nerfvdb
