// SPDX-License-Identifier: Apache-2.0
// Derives the table of marching cubes: trace loops over the faces of the cube, then fill each loop.
#include "export/marching_cubes_table.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <limits>

#include "core/types.h"

namespace nerfvdb {
namespace {

constexpr int kAxisBit[3] = {4, 2, 1};   // step to the next corner along an axis
using Loop = std::vector<std::uint8_t>;  // edges in order; what is inside lies behind, seen counter-clockwise

std::array<CubeEdge, kCubeEdges> makeEdges() {
    std::array<CubeEdge, kCubeEdges> edges;
    int n = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (int corner = 0; corner < 8; ++corner)
            if (!(corner & kAxisBit[axis])) edges[n++] = {axis, corner >> 2 & 1, corner >> 1 & 1, corner & 1};
    return edges;
}

/// Corners counter-clockwise as seen from outside the cube.
std::array<std::array<std::uint8_t, 4>, 6> makeFaces() {
    std::array<std::array<std::uint8_t, 4>, 6> faces;
    for (int face = 0; face < 6; ++face) {
        const int axis = face / 2, side = face % 2;
        const int u = kAxisBit[(axis + 1) % 3], v = kAxisBit[(axis + 2) % 3];
        const int base = side ? kAxisBit[axis] : 0;
        const int ring[4] = {base, base | u, base | u | v, base | v};
        for (int i = 0; i < 4; ++i) faces[face][i] = static_cast<std::uint8_t>(ring[side ? i : (4 - i) % 4]);
    }
    return faces;
}

class TableMaker {
public:
    explicit TableMaker(CubeTable& table) : table_(table) {
        table.edges = makeEdges();
        table.face_corners = makeFaces();
        for (int face = 0; face < 6; ++face)
            for (int i = 0; i < 4; ++i)
                face_edges_[face][i] =
                    edgeBetween(table.face_corners[face][i], table.face_corners[face][(i + 1) % 4]);
        for (int pattern = 0; pattern < 256; ++pattern) {
            CubePattern& entry = table.patterns[pattern];
            entry.first_variant = static_cast<std::uint16_t>(table.variants.size());
            for (int face = 0; face < 6; ++face)
                if (isAmbiguous(pattern, face)) entry.ambiguous_faces |= 1 << face;
            const int n_variants = 1 << std::popcount(entry.ambiguous_faces);
            for (int answers = 0; answers < n_variants; ++answers)
                table.variants.push_back(fill(trace(pattern, answers)));
        }
    }

private:
    std::uint8_t edgeBetween(int a, int b) const {
        const int low = std::min(a, b), step = std::max(a, b) - low;
        const auto edge = std::find_if(table_.edges.begin(), table_.edges.end(), [&](const CubeEdge& e) {
            return e.x * 4 + e.y * 2 + e.z == low && kAxisBit[e.axis] == step;
        });
        return static_cast<std::uint8_t>(edge - table_.edges.begin());
    }

    bool isInside(int pattern, int face, int i) const {
        return pattern >> table_.face_corners[face][i & 3] & 1;
    }
    bool isAmbiguous(int pattern, int face) const {
        return isInside(pattern, face, 0) == isInside(pattern, face, 2) &&
               isInside(pattern, face, 1) == isInside(pattern, face, 3) &&
               isInside(pattern, face, 0) != isInside(pattern, face, 1);
    }

    /// Walking around a face, side i *enters* when it leads from outside to inside and *leaves* when back. A
    /// segment runs from where the walk enters to where it leaves: around the inside corners if these are kept
    /// apart, or from one entry back to the exit before it, around an outside corner, if they are joined.
    /// Neighbouring faces walk along their common edge in opposite directions, so one segment ends there and
    /// one begins.
    std::vector<Loop> trace(int pattern, int answers) const {
        std::array<int, kCubeEdges> next;
        next.fill(-1);
        for (int face = 0, ambiguous = 0; face < 6; ++face) {
            const bool is_joined = isAmbiguous(pattern, face) && (answers >> ambiguous++ & 1);
            for (int i = 0; i < 4; ++i) {
                if (isInside(pattern, face, i) || !isInside(pattern, face, i + 1)) continue;
                int leaving = i;
                do leaving = (leaving + (is_joined ? 3 : 1)) % 4;
                while (!isInside(pattern, face, leaving) || isInside(pattern, face, leaving + 1));
                next[face_edges_[face][i]] = face_edges_[face][leaving];
            }
        }
        std::vector<Loop> loops;
        for (int start = 0; start < kCubeEdges; ++start) {
            Loop loop;
            for (int edge = start; next[edge] >= 0;) {
                loop.push_back(static_cast<std::uint8_t>(edge));
                const int following = next[edge];
                next[edge] = -1;
                edge = following;
            }
            if (!loop.empty()) loops.push_back(loop);
        }
        return loops;
    }

    bool shareFace(int edge_a, int edge_b) const {
        return std::any_of(face_edges_.begin(), face_edges_.end(), [&](const auto& edges) {
            return std::count(edges.begin(), edges.end(), edge_a) &&
                   std::count(edges.begin(), edges.end(), edge_b);
        });
    }

    Eigen::Vector3d middle(int edge) const {
        const CubeEdge& e = table_.edges[edge];
        Eigen::Vector3d point(e.x, e.y, e.z);
        point[e.axis] += 0.5;
        return point;
    }

    CubeTriangles fill(const std::vector<Loop>& loops) const {
        CubeTriangles result;
        const auto add = [&](int a, int b, int c) {
            result.triangles[result.count++] = {static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b),
                                                static_cast<std::uint8_t>(c)};
        };
        for (const Loop& loop : loops)
            if (!fillWithChords(loop, add)) {
                for (std::size_t i = 0; i < loop.size(); ++i)
                    add(loop[i], loop[(i + 1) % loop.size()], kCubeCentre);
                result.has_centre = true;
            }
        return result;
    }

    /// The triangulation of least area (crossings at the middle of their edges) among those without a chord in
    /// a face of the cube; false if there is none. Dynamic programming over the sub-polygons i..j.
    template <typename Add>
    bool fillWithChords(const Loop& loop, const Add& add) const {
        constexpr double kNone = std::numeric_limits<double>::infinity();
        const int n = static_cast<int>(loop.size());
        std::array<std::array<double, kCubeEdges>, kCubeEdges> area{};
        std::array<std::array<int, kCubeEdges>, kCubeEdges> apex{};
        for (int span = 2; span < n; ++span)
            for (int i = 0, j = span; j < n; ++i, ++j) {
                area[i][j] = kNone;
                const bool is_chord = span < n - 1;
                if (is_chord && shareFace(loop[i], loop[j])) continue;
                for (int k = i + 1; k < j; ++k) {
                    const Eigen::Vector3d a = middle(loop[i]), b = middle(loop[k]), c = middle(loop[j]);
                    const double sum = area[i][k] + area[k][j] + 0.5 * (b - a).cross(c - a).norm();
                    // The margin makes ties fall to the lowest k on every machine.
                    if (sum < area[i][j] - 1e-9 || area[i][j] == kNone) area[i][j] = sum, apex[i][j] = k;
                }
            }
        if (area[0][n - 1] == kNone) return false;
        const auto emit = [&](const auto& self, int i, int j) -> void {
            if (j - i < 2) return;
            const int k = apex[i][j];
            add(loop[i], loop[k], loop[j]);
            self(self, i, k);
            self(self, k, j);
        };
        emit(emit, 0, n - 1);
        return true;
    }

    CubeTable& table_;
    std::array<std::array<std::uint8_t, 4>, 6> face_edges_{};
};

}  // namespace

const CubeTable& cubeTable() {
    static const CubeTable table = [] {
        CubeTable made;
        TableMaker{made};
        return made;
    }();
    return table;
}

}  // namespace nerfvdb
