// SPDX-License-Identifier: Apache-2.0
// Fewer triangles for the same shape. The only file that knows meshoptimizer is beside it.
#pragma once

#include "export/mesh.h"

namespace nerfvdb {

/// No closed mesh has fewer triangles.
inline constexpr std::size_t kFewestFaces = 4;

/// Collapses edges, those first whose loss moves the surface least (quadric error), until `n_faces` triangles are left.
/// A closed mesh stays closed and manifold, whatever the number.
///
/// meshoptimizer does not look at topology: it closes tubes and tunnels to lines and would leave more than two
/// triangles at them. So the number of triangles is halved, again and again; where a halving made the surface touch
/// itself, what was there before stays and the rest is done once more, so that pieces, tubes and tunnels survive. Once
/// a surface has more of those than the number has room for, the number comes first: the rest is done at once, and
/// where the surface touches itself it is cut apart there (makeManifold), into pieces that lie against each other.
///
/// What stays of the vertices keeps its place, normal and colour. A mesh with no more triangles than asked for stays as
/// it is. The number is met within some percent; with very few triangles it may not be.
/// Cost:    some 5 seconds a million triangles, on one thread; some 150 bytes a triangle.
/// Errors:  NumericError for fewer than kFewestFaces; throws as checkTriangles.
/// Source:  Garland and Heckbert 1997, "Surface simplification using quadric error metrics", as meshoptimizer has it.
void simplifyMesh(Mesh& mesh, std::size_t n_faces);

}  // namespace nerfvdb
