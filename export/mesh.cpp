// SPDX-License-Identifier: Apache-2.0
// Measures of a mesh: edges counted by bucket, pieces by union-find.
#include "export/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <string>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// Every side of every triangle, in a bucket by its lower vertex: 2 * (upper vertex) + (1 if it runs
/// downwards).
struct Sides {
    std::vector<std::size_t> bucket_begin;  // [vertices + 1]
    std::vector<std::uint64_t> ends;        // [3 * triangles]
};

Sides bucketSides(const Mesh& mesh) {
    Sides sides;
    sides.bucket_begin.assign(mesh.positions.size() + 2, 0);
    sides.ends.resize(mesh.triangles.size() * 3);
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) ++sides.bucket_begin[std::min(t[k], t[(k + 1) % 3]) + 2];
    std::partial_sum(sides.bucket_begin.begin(), sides.bucket_begin.end(), sides.bucket_begin.begin());
    // Counts stand two places late, so that filling moves each begin to where it belongs.
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t from = t[k], to = t[(k + 1) % 3];
            sides.ends[sides.bucket_begin[std::min(from, to) + 1]++] =
                std::uint64_t{std::max(from, to)} * 2 + (from > to);
        }
    sides.bucket_begin.pop_back();
    return sides;
}

void countEdges(const Mesh& mesh, MeshMeasures& measures) {
    Sides sides = bucketSides(mesh);
    for (std::size_t v = 0; v + 1 < sides.bucket_begin.size(); ++v) {
        const auto begin = sides.ends.begin() + sides.bucket_begin[v];
        const auto end = sides.ends.begin() + sides.bucket_begin[v + 1];
        std::sort(begin, end);
        for (auto side = begin; side != end;) {
            const auto next = std::find_if(side, end, [&](std::uint64_t e) { return e / 2 != *side / 2; });
            const std::size_t up = std::count_if(side, next, [](std::uint64_t e) { return e % 2 == 0; });
            const std::size_t down = next - side - up;
            ++measures.edges;
            if (up + down == 1)
                ++measures.open_edges;
            else if (up != 1 || down != 1)
                ++measures.bad_edges;
            side = next;
        }
    }
}

}  // namespace

void checkTriangles(const Mesh& mesh) {
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        if (mesh.triangles[i].maxCoeff() >= mesh.positions.size())
            throw DataError("mesh: triangle " + std::to_string(i),
                            "vertex " + std::to_string(mesh.triangles[i].maxCoeff()),
                            "a number below " + std::to_string(mesh.positions.size()));
}

std::vector<std::uint32_t> piecesOfVertices(const Mesh& mesh) {
    checkTriangles(mesh);
    // Union-find; the root of a set is its lowest vertex.
    std::vector<std::uint32_t> parent(mesh.positions.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root = [&](std::uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles)
        for (int k = 1; k < 3; ++k) {
            const std::uint32_t a = root(t[0]), b = root(t[k]);
            parent[std::max(a, b)] = std::min(a, b);
        }
    // A root comes before its members, so one pass turns roots into piece numbers.
    std::vector<std::uint32_t> piece(parent.size());
    std::uint32_t n_pieces = 0;
    for (std::uint32_t v = 0; v < parent.size(); ++v) {
        const std::uint32_t r = root(v);
        piece[v] = r == v ? n_pieces++ : piece[r];
    }
    return piece;
}

MeshMeasures measureMesh(const Mesh& mesh) {
    MeshMeasures measures;
    const std::vector<std::uint32_t> piece = piecesOfVertices(mesh);
    std::vector<bool> is_used(mesh.positions.size(), false), is_piece(mesh.positions.size(), false);
    // Volumes are summed about a corner of the mesh: far from the origin the terms would cancel.
    const Vec3d center = mesh.positions.empty() ? Vec3d::Zero() : Vec3d(mesh.positions[0].cast<double>());
    for (const Triangle& t : mesh.triangles) {
        const Vec3d a = mesh.positions[t[0]].cast<double>() - center;
        const Vec3d b = mesh.positions[t[1]].cast<double>() - center;
        const Vec3d c = mesh.positions[t[2]].cast<double>() - center;
        const Vec3d normal = (b - a).cross(c - a);
        measures.area += 0.5 * normal.norm();
        measures.volume += a.dot(b.cross(c)) / 6;
        measures.degenerate_faces += normal.squaredNorm() == 0;
        for (int k = 0; k < 3; ++k) is_used[t[k]] = true;
        is_piece[piece[t[0]]] = true;
    }
    measures.pieces = std::count(is_piece.begin(), is_piece.end(), true);
    countEdges(mesh, measures);
    measures.euler = std::count(is_used.begin(), is_used.end(), true) -
                     static_cast<std::int64_t>(measures.edges) +
                     static_cast<std::int64_t>(mesh.triangles.size());
    return measures;
}

}  // namespace nerfvdb
