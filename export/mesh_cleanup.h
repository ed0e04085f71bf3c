// SPDX-License-Identifier: Apache-2.0
// Takes floating crumbs off a mesh. Whole pieces go or stay, so that a closed mesh stays closed.
#pragma once

#include <cstddef>

#include "export/mesh.h"

namespace nerfvdb {

/// A piece stays if every rule lets it. All zero: every piece stays.
struct IslandOptions {
    std::size_t keep_largest = 0;  // keep so many pieces, those with the most triangles; 0: no limit
    std::size_t min_faces = 0;     // drop pieces with fewer triangles
    double min_share = 0;          // drop pieces with fewer triangles than this share of the largest piece's
};

/// A min_share that drops crumbs and keeps objects: a body with a fourteenth of the largest one's diameter stays.
/// Measured: crumbs of models trained from pictures have up to 0.0032, the smallest object of the procedural scenes
/// has 0.1.
inline constexpr double kCrumbShare = 0.005;

struct IslandCounts {
    std::size_t kept_pieces = 0, dropped_pieces = 0;
    std::size_t dropped_faces = 0;
    std::size_t largest_faces = 0;  // of the largest piece
};

/// Removes pieces (triangles joined by vertices) and the vertices that no triangle uses; what stays keeps its
/// order. Of pieces with equally many triangles, that with the lowest vertex counts as larger. Throws DataError
/// when a triangle names a vertex that does not exist.
IslandCounts removeIslands(Mesh& mesh, const IslandOptions& options);

}  // namespace nerfvdb
