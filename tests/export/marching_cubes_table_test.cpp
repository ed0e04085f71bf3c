// SPDX-License-Identifier: Apache-2.0
#include "export/marching_cubes_table.h"

#include <bit>
#include <map>
#include <set>

#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Whether two crossings (edges of the cube) lie on a common face.
bool shareFace(const CubeTable& table, int edge_a, int edge_b) {
    for (int face = 0; face < 6; ++face) {
        const auto isOn = [&](int edge) {
            const CubeEdge& e = table.edges[edge];
            const int low[3] = {e.x, e.y, e.z};
            return e.axis != face / 2 && low[face / 2] == face % 2;
        };
        if (isOn(edge_a) && isOn(edge_b)) return true;
    }
    return false;
}

int findRoot(std::array<int, 8>& parent, int corner) {
    while (parent[corner] != corner) corner = parent[corner];
    return corner;
}

/// Pieces into which the corners of the cube fall, if corners of one kind hang together along edges and across
/// ambiguous faces as answered. The loops between the pieces on the cube's surface are one fewer.
int countPieces(const CubeTable& table, int pattern, unsigned answers) {
    std::array<int, 8> parent;
    for (int c = 0; c < 8; ++c) parent[c] = c;
    const auto join = [&](int a, int b) { parent[findRoot(parent, a)] = findRoot(parent, b); };
    const auto isInside = [&](int c) { return (pattern >> c & 1) != 0; };
    for (int c = 0; c < 8; ++c)
        for (const int step : {4, 2, 1})
            if (isInside(c) == isInside(c ^ step)) join(c, c ^ step);
    int n = 0;
    for (int face = 0; face < 6; ++face) {
        if (!(table.patterns[pattern].ambiguous_faces >> face & 1)) continue;
        const auto& corners = table.face_corners[face];
        const bool is_joined = answers >> n++ & 1;
        const int first = isInside(corners[0]) == is_joined ? 0 : 1;
        join(corners[first], corners[first + 2]);
    }
    std::set<int> roots;
    for (int c = 0; c < 8; ++c) roots.insert(findRoot(parent, c));
    return static_cast<int>(roots.size());
}

}  // namespace

TEST_CASE("a face is ambiguous exactly where its corners alternate", "[export]") {
    const CubeTable& table = cubeTable();
    CHECK(table.patterns[0].ambiguous_faces == 0);
    CHECK(table.patterns[1 << 0 | 1 << 7].ambiguous_faces == 0);                 // opposite corners of the cube
    CHECK(std::popcount(table.patterns[1 << 0 | 1 << 3].ambiguous_faces) == 1);  // (0,0,0), (0,1,1): face x = 0
    CHECK(table.patterns[1 << 0 | 1 << 3].ambiguous_faces == 1);
    CHECK(table.patterns[0b01101001].ambiguous_faces == 0b111111);  // checkerboard
    CHECK(table.variants.size() == 656);                            // sum over patterns of 2^(ambiguous faces)
}

TEST_CASE("every variant of every cube is a set of discs that end on the cube's faces", "[export]") {
    const CubeTable& table = cubeTable();
    for (int pattern = 0; pattern < 256; ++pattern) {
        const unsigned n_answers = 1u << std::popcount(table.patterns[pattern].ambiguous_faces);
        for (unsigned answers = 0; answers < n_answers; ++answers) {
            const CubeTriangles& cube = table.variants[table.patterns[pattern].first_variant + answers];
            INFO("pattern " << pattern << ", answers " << answers);
            std::map<std::pair<int, int>, int> sides;
            std::set<int> vertices;
            for (int i = 0; i < cube.count; ++i) {
                const auto& t = cube.triangles[i];
                REQUIRE((t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
                for (int k = 0; k < 3; ++k) {
                    vertices.insert(t[k]);
                    REQUIRE(++sides[{t[k], t[(k + 1) % 3]}] == 1);
                }
            }
            // Open sides lie on faces of the cube, all others inside it, off every face.
            int n_open = 0, n_shared = 0;
            for (const auto& [side, count] : sides) {
                const bool is_open = !sides.count({side.second, side.first});
                const bool has_centre = side.first == kCubeCentre || side.second == kCubeCentre;
                REQUIRE(is_open == (!has_centre && shareFace(table, side.first, side.second)));
                (is_open ? n_open : n_shared) += 1;
            }
            // Exactly the crossed edges are used.
            for (int e = 0; e < kCubeEdges; ++e) {
                const CubeEdge& edge = table.edges[e];
                const int low = edge.x * 4 + edge.y * 2 + edge.z, high = low + (4 >> edge.axis);
                REQUIRE((vertices.count(e) == 1) == ((pattern >> low & 1) != (pattern >> high & 1)));
            }
            REQUIRE((vertices.count(kCubeCentre) == 1) == cube.has_centre);
            // Euler: one disc per loop, and as many loops as borders between pieces of the cube's surface.
            const int n_discs = static_cast<int>(vertices.size()) - (n_open + n_shared / 2) + cube.count;
            REQUIRE(n_discs == (pattern == 0 || pattern == 255 ? 0 : countPieces(table, pattern, answers) - 1));
        }
    }
}

TEST_CASE("a single corner is cut off by a triangle that looks away from it", "[export]") {
    const CubeTable& table = cubeTable();
    const CubeTriangles& cube = table.variants[table.patterns[1].first_variant];
    REQUIRE(cube.count == 1);
    // Crossings on the x, y, z edges of corner 0, counter-clockwise seen from (1, 1, 1).
    std::array<int, 3> axes;
    for (int k = 0; k < 3; ++k) axes[k] = table.edges[cube.triangles[0][k]].axis;
    CHECK((axes[1] == (axes[0] + 1) % 3 && axes[2] == (axes[1] + 1) % 3));
}
