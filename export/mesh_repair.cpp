// SPDX-License-Identifier: Apache-2.0
// A *side* is one of a triangle's three directed edges: number 3 * triangle + k, from corner k to corner k + 1. It also
// stands for the corner from which it starts.
#include "export/mesh_repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <tuple>

#include "export/mesh_cleanup.h"

namespace nerfvdb {
namespace {

using Side = std::uint32_t;
constexpr Side kNone = ~Side{0};

Side nextOf(Side side) { return side % 3 == 2 ? side - 2 : side + 1; }
Side lastOf(Side side) { return side % 3 == 0 ? side + 2 : side - 1; }

std::uint32_t from(const Mesh& mesh, Side side) { return mesh.triangles[side / 3][side % 3]; }
std::uint32_t to(const Mesh& mesh, Side side) { return from(mesh, nextOf(side)); }

// --- faces that cancel ------------------------------------------------------------------------------------------

/// Removes triangles that name a vertex twice, and pairs of the same three vertices that face each other.
std::size_t dropCancelling(Mesh& mesh) {
    struct Face {
        std::array<std::uint32_t, 3> vertices;  // rising
        bool is_odd;                            // the triangle runs through them backwards
        std::uint32_t number;
        auto key() const { return std::tie(vertices, is_odd, number); }
    };
    std::vector<bool> is_dropped(mesh.triangles.size(), false);
    std::vector<Face> faces;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const Triangle& t = mesh.triangles[i];
        is_dropped[i] = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        if (is_dropped[i]) continue;
        const int swaps = (t[0] > t[1]) + (t[1] > t[2]) + (t[0] > t[2]);
        Face face{{t[0], t[1], t[2]}, swaps % 2 == 1, i};
        std::sort(face.vertices.begin(), face.vertices.end());
        faces.push_back(face);
    }
    std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key() < b.key(); });
    for (auto first = faces.begin(); first != faces.end();) {
        const auto end = std::find_if(first, faces.end(), [&](const Face& f) { return f.vertices != first->vertices; });
        const auto odd = std::find_if(first, end, [](const Face& f) { return f.is_odd; });
        const std::ptrdiff_t pairs = std::min(odd - first, end - odd);
        for (std::ptrdiff_t i = 0; i < pairs; ++i) is_dropped[first[i].number] = is_dropped[odd[i].number] = true;
        first = end;
    }
    const std::size_t before = mesh.triangles.size();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < before; ++i)
        if (!is_dropped[i]) mesh.triangles[kept++] = mesh.triangles[i];
    mesh.triangles.resize(kept);
    return before - kept;
}

// --- which sides belong together --------------------------------------------------------------------------------

struct EdgeSide {
    std::uint64_t edge;  // lower vertex, upper vertex
    Side side;
};

/// All sides, those of one edge in a row.
std::vector<EdgeSide> sidesByEdge(const Mesh& mesh) {
    std::vector<EdgeSide> sides(mesh.triangles.size() * 3);
    for (Side side = 0; side < sides.size(); ++side) {
        const auto [low, high] = std::minmax({from(mesh, side), to(mesh, side)});
        sides[side] = {std::uint64_t{low} << 32 | high, side};
    }
    std::sort(sides.begin(), sides.end(),
              [](const EdgeSide& a, const EdgeSide& b) { return std::tie(a.edge, a.side) < std::tie(b.edge, b.side); });
    return sides;
}

/// Calls visit(span) with the sides of each edge.
template <typename Visit>
void forEachEdge(std::span<const EdgeSide> sides, const Visit& visit) {
    for (std::size_t first = 0, end = 0; first < sides.size(); first = end) {
        while (end < sides.size() && sides[end].edge == sides[first].edge) ++end;
        visit(sides.subspan(first, end - first));
    }
}

/// Pairs the sides of one edge about it. Seen along the edge, counter-clockwise, solid comes after a triangle whose
/// side runs down and before one whose side runs up: they are as brackets around a wedge of solid.
void pairAboutEdge(const Mesh& mesh, std::span<const EdgeSide> sides, std::vector<Side>& partner) {
    const std::uint32_t low = std::min(from(mesh, sides[0].side), to(mesh, sides[0].side));
    const std::uint32_t high = std::max(from(mesh, sides[0].side), to(mesh, sides[0].side));
    const Vec3d origin = mesh.positions[low].cast<double>();
    const Vec3d along = (mesh.positions[high].cast<double>() - origin).normalized();
    const Vec3d right = along.unitOrthogonal(), front = along.cross(right);
    std::vector<std::tuple<double, bool, Side>> brackets;  // angle, does it close, side
    for (const EdgeSide& s : sides) {
        const Vec3d apex = mesh.positions[from(mesh, lastOf(s.side))].cast<double>() - origin;
        brackets.push_back({std::atan2(apex.dot(front), apex.dot(right)), from(mesh, s.side) == low, s.side});
    }
    std::sort(brackets.begin(), brackets.end());
    std::vector<Side> open;
    // The second turn closes wedges that reach over the angle where the first began.
    for (int turn = 0; turn < 2; ++turn)
        for (const auto& [angle, is_closing, side] : brackets) {
            if (partner[side] != kNone) continue;
            if (!is_closing) {
                if (turn == 0) open.push_back(side);
            } else if (!open.empty()) {
                partner[side] = open.back();
                partner[open.back()] = side;
                open.pop_back();
            }
        }
}

/// For each side the one across the edge, or kNone.
std::vector<Side> pairSides(const Mesh& mesh) {
    const std::vector<EdgeSide> sides = sidesByEdge(mesh);
    std::vector<Side> partner(sides.size(), kNone);
    forEachEdge(sides, [&](std::span<const EdgeSide> edge) {
        if (edge.size() > 2) return pairAboutEdge(mesh, edge, partner);
        if (edge.size() < 2 || from(mesh, edge[0].side) == from(mesh, edge[1].side)) return;
        partner[edge[0].side] = edge[1].side;
        partner[edge[1].side] = edge[0].side;
    });
    return partner;
}

// --- one vertex for each ring -----------------------------------------------------------------------------------

std::uint32_t addVertex(Mesh& mesh, std::uint32_t a, std::uint32_t b) {
    mesh.positions.push_back(0.5f * (mesh.positions[a] + mesh.positions[b]));
    if (!mesh.normals.empty()) {
        const Vec3f sum = mesh.normals[a] + mesh.normals[b];
        mesh.normals.push_back(sum.norm() > 0 ? sum.normalized() : mesh.normals[a]);
    }
    if (!mesh.colours.empty())
        mesh.colours.push_back(((mesh.colours[a].cast<int>() + mesh.colours[b].cast<int>()) / 2).cast<std::uint8_t>());
    return static_cast<std::uint32_t>(mesh.positions.size() - 1);
}

/// For each corner the lowest one of its ring: corners are joined across paired sides.
std::vector<Side> ringsOfCorners(const std::vector<Side>& partner) {
    std::vector<Side> parent(partner.size());
    std::iota(parent.begin(), parent.end(), Side{0});
    const auto root = [&](Side corner) {
        while (parent[corner] != corner) corner = parent[corner] = parent[parent[corner]];
        return corner;
    };
    const auto join = [&](Side a, Side b) {
        a = root(a);
        b = root(b);
        parent[std::max(a, b)] = std::min(a, b);
    };
    for (Side side = 0; side < partner.size(); ++side)
        if (partner[side] != kNone && partner[side] > side) {
            join(side, nextOf(partner[side]));
            join(nextOf(side), partner[side]);
        }
    for (Side corner = 0; corner < parent.size(); ++corner) parent[corner] = root(corner);
    return parent;
}

/// Each ring of a vertex but the first gets a copy of it.
std::size_t splitRings(Mesh& mesh, const std::vector<Side>& partner) {
    const std::vector<Side> ring_of = ringsOfCorners(partner);
    const std::size_t n_before = mesh.positions.size();
    constexpr std::uint32_t kFree = ~std::uint32_t{0};
    std::vector<Side> first_ring(n_before, kNone);
    std::vector<std::uint32_t> vertex_of_ring(partner.size(), kFree);  // by root
    for (Side corner = 0; corner < partner.size(); ++corner) {
        const Side ring = ring_of[corner];
        std::uint32_t& vertex = mesh.triangles[corner / 3][corner % 3];
        if (vertex_of_ring[ring] == kFree) {
            const bool is_first = first_ring[vertex] == kNone;
            if (is_first) first_ring[vertex] = ring;
            vertex_of_ring[ring] = is_first ? vertex : addVertex(mesh, vertex, vertex);
        }
        vertex = vertex_of_ring[ring];
    }
    return mesh.positions.size() - n_before;
}

// --- edges that are doubled still -------------------------------------------------------------------------------

/// Puts a midpoint into all but the first pair of every edge, as far as no triangle is cut twice.
std::size_t splitDoubledEdges(Mesh& mesh, const std::vector<Side>& partner) {
    std::vector<Side> pairs;  // the lower side of each that has to be split
    forEachEdge(sidesByEdge(mesh), [&](std::span<const EdgeSide> edge) {
        for (const EdgeSide& s : edge.subspan(1))
            if (partner[s.side] != kNone && s.side < partner[s.side]) pairs.push_back(s.side);
    });
    std::vector<bool> is_cut(mesh.triangles.size(), false);
    std::size_t n_split = 0;
    for (const Side side : pairs) {
        const Side across = partner[side];
        if (is_cut[side / 3] || is_cut[across / 3]) continue;
        is_cut[side / 3] = is_cut[across / 3] = true;
        const std::uint32_t middle = addVertex(mesh, from(mesh, side), to(mesh, side));
        for (const Side half : {side, across}) {
            Triangle rest = mesh.triangles[half / 3];
            mesh.triangles[half / 3][nextOf(half) % 3] = middle;
            rest[half % 3] = middle;
            mesh.triangles.push_back(rest);
        }
        ++n_split;
    }
    return n_split;
}

}  // namespace

std::vector<std::uint32_t> nonManifoldVertices(const Mesh& mesh) {
    checkTriangles(mesh);
    std::vector<bool> is_bad(mesh.positions.size(), false);
    forEachEdge(sidesByEdge(mesh), [&](std::span<const EdgeSide> edge) {
        const bool is_open = edge.size() == 1;
        if (is_open) return;
        const Side a = edge[0].side, b = edge[1].side;
        if (edge.size() > 2 || from(mesh, a) == from(mesh, b))
            is_bad[from(mesh, a)] = is_bad[to(mesh, a)] = true;
        else if (from(mesh, lastOf(a)) == from(mesh, lastOf(b)))
            for (int k = 0; k < 3; ++k) is_bad[mesh.triangles[a / 3][k]] = true;
    });
    const std::vector<Side> ring_of = ringsOfCorners(pairSides(mesh));
    std::vector<Side> ring_of_vertex(mesh.positions.size(), kNone);
    for (Side corner = 0; corner < ring_of.size(); ++corner) {
        const std::uint32_t vertex = mesh.triangles[corner / 3][corner % 3];
        if (ring_of_vertex[vertex] == kNone) ring_of_vertex[vertex] = ring_of[corner];
        if (ring_of_vertex[vertex] != ring_of[corner]) is_bad[vertex] = true;
    }
    std::vector<std::uint32_t> bad;
    for (std::uint32_t v = 0; v < is_bad.size(); ++v)
        if (is_bad[v]) bad.push_back(v);
    return bad;
}

RepairCounts makeManifold(Mesh& mesh) {
    checkTriangles(mesh);
    RepairCounts counts;
    counts.dropped_faces = dropCancelling(mesh);
    for (;;) {
        const std::vector<Side> partner = pairSides(mesh);
        counts.added_vertices += splitRings(mesh, partner);
        const std::size_t n_split = splitDoubledEdges(mesh, partner);
        counts.added_vertices += n_split;
        if (n_split == 0) break;
    }
    removeIslands(mesh, {});
    return counts;
}

}  // namespace nerfvdb
