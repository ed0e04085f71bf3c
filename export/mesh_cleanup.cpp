// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_cleanup.h"

#include <algorithm>
#include <numeric>

namespace nerfvdb {
namespace {

/// Numbers of triangles per piece.
std::vector<std::size_t> countFaces(const Mesh& mesh, const std::vector<std::uint32_t>& piece_of_vertex) {
    std::uint32_t n_pieces = 0;
    for (const std::uint32_t piece : piece_of_vertex) n_pieces = std::max(n_pieces, piece + 1);
    std::vector<std::size_t> n_faces(n_pieces, 0);
    for (const Triangle& t : mesh.triangles) ++n_faces[piece_of_vertex[t[0]]];
    return n_faces;
}

std::vector<bool> choosePieces(const std::vector<std::size_t>& n_faces, const IslandOptions& options) {
    std::vector<std::uint32_t> by_size(n_faces.size());
    std::iota(by_size.begin(), by_size.end(), 0u);
    std::stable_sort(by_size.begin(), by_size.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return n_faces[a] > n_faces[b]; });
    const double min_share_faces = by_size.empty() ? 0 : options.min_share * static_cast<double>(n_faces[by_size[0]]);
    std::vector<bool> is_kept(n_faces.size(), false);
    for (std::size_t i = 0; i < by_size.size(); ++i) {
        const std::size_t faces = n_faces[by_size[i]];
        const bool is_among_largest = options.keep_largest == 0 || i < options.keep_largest;
        is_kept[by_size[i]] = faces > 0 && faces >= options.min_faces && is_among_largest &&
                              static_cast<double>(faces) >= min_share_faces;
    }
    return is_kept;
}

}  // namespace

IslandCounts removeIslands(Mesh& mesh, const IslandOptions& options) {
    const std::vector<std::uint32_t> piece = piecesOfVertices(mesh);
    const std::vector<std::size_t> n_faces = countFaces(mesh, piece);
    const std::vector<bool> is_kept = choosePieces(n_faces, options);
    IslandCounts counts;
    for (std::size_t p = 0; p < n_faces.size(); ++p) {
        if (n_faces[p] == 0) continue;  // a vertex that no triangle uses
        ++(is_kept[p] ? counts.kept_pieces : counts.dropped_pieces);
        if (!is_kept[p]) counts.dropped_faces += n_faces[p];
        counts.largest_faces = std::max(counts.largest_faces, n_faces[p]);
    }

    // Everything moves towards the front, in place.
    std::vector<std::uint32_t> new_number(mesh.positions.size());
    std::uint32_t n_vertices = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        if (!is_kept[piece[v]]) continue;
        mesh.positions[n_vertices] = mesh.positions[v];
        if (!mesh.normals.empty()) mesh.normals[n_vertices] = mesh.normals[v];
        if (!mesh.colours.empty()) mesh.colours[n_vertices] = mesh.colours[v];
        new_number[v] = n_vertices++;
    }
    std::size_t n_triangles = 0;
    for (const Triangle& t : mesh.triangles)
        if (is_kept[piece[t[0]]])
            mesh.triangles[n_triangles++] = Triangle(new_number[t[0]], new_number[t[1]], new_number[t[2]]);
    mesh.positions.resize(n_vertices);
    if (!mesh.normals.empty()) mesh.normals.resize(n_vertices);
    if (!mesh.colours.empty()) mesh.colours.resize(n_vertices);
    mesh.triangles.resize(n_triangles);
    return counts;
}

}  // namespace nerfvdb
