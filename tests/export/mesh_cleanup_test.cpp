// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_cleanup.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Adds a closed double cone over a ring of n vertices: 2 n triangles, n + 2 vertices. Normals and colours name
/// the piece, so that a test can tell whose they are.
void addPiece(Mesh& mesh, std::uint32_t n, std::uint8_t name) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (std::uint32_t v = 0; v < n + 2; ++v) {
        mesh.positions.push_back(Vec3f(static_cast<float>(v), name, 0));
        mesh.normals.push_back(Vec3f(name, 0, 0));
        mesh.colours.push_back(Rgb8(name, name, name));
    }
    for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t a = first + i, b = first + (i + 1) % n;
        mesh.triangles.push_back({a, b, first + n});
        mesh.triangles.push_back({b, a, first + n + 1});
    }
}

/// Pieces of 6, 10, 8 and 6 triangles, and a vertex that no triangle uses.
Mesh fourPieces() {
    Mesh mesh;
    addPiece(mesh, 3, 1);
    addPiece(mesh, 5, 2);
    mesh.positions.push_back(Vec3f::Zero());
    mesh.normals.push_back(Vec3f::Zero());
    mesh.colours.push_back(Rgb8::Zero());
    addPiece(mesh, 4, 3);
    addPiece(mesh, 3, 4);
    return mesh;
}

std::vector<int> names(const Mesh& mesh) {
    std::vector<int> found;
    for (const Triangle& t : mesh.triangles) {
        const int name = mesh.colours[t[0]][0];
        for (int k = 0; k < 3; ++k) {
            REQUIRE(mesh.colours[t[k]][0] == name);
            REQUIRE(mesh.positions[t[k]].y() == static_cast<float>(name));
            REQUIRE(mesh.normals[t[k]].x() == static_cast<float>(name));
        }
        if (found.empty() || found.back() != name) found.push_back(name);
    }
    return found;
}

}  // namespace

TEST_CASE("the largest pieces stay, in their order; ties go to the first", "[export]") {
    Mesh mesh = fourPieces();
    const IslandCounts counts = removeIslands(mesh, {.keep_largest = 3});
    CHECK(names(mesh) == std::vector<int>{1, 2, 3});
    CHECK(counts.kept_pieces == 3);
    CHECK(counts.dropped_pieces == 1);
    CHECK(counts.dropped_faces == 6);
    CHECK(counts.largest_faces == 10);
    CHECK(mesh.positions.size() == 5 + 7 + 6);
    CHECK(measureMesh(mesh).closed());
    CHECK(measureMesh(mesh).pieces == 3);

    removeIslands(mesh, {.keep_largest = 1});
    CHECK(names(mesh) == std::vector<int>{2});
}

TEST_CASE("pieces with too few faces go", "[export]") {
    Mesh mesh = fourPieces();
    const IslandCounts counts = removeIslands(mesh, {.min_faces = 8});
    CHECK(names(mesh) == std::vector<int>{2, 3});
    CHECK(counts.dropped_faces == 12);
    Mesh none = fourPieces();
    removeIslands(none, {.min_faces = 11});
    CHECK(none.positions.empty());
    CHECK(none.triangles.empty());
}

TEST_CASE("pieces that are small beside the largest go; a piece of just the share stays", "[export]") {
    Mesh mesh = fourPieces();
    CHECK(removeIslands(mesh, {.min_share = 0.8}).dropped_pieces == 2);
    CHECK(names(mesh) == std::vector<int>{2, 3});
    Mesh both = fourPieces();
    removeIslands(both, {.min_faces = 9, .min_share = 0.6});
    CHECK(names(both) == std::vector<int>{2});
    Mesh all = fourPieces();
    CHECK(removeIslands(all, {.min_share = 0.6}).dropped_faces == 0);
}

TEST_CASE("without limits only unused vertices go", "[export]") {
    Mesh mesh = fourPieces();
    const Mesh before = mesh;
    CHECK(removeIslands(mesh, {}).dropped_pieces == 0);
    CHECK(mesh.triangles.size() == before.triangles.size());
    CHECK(mesh.positions.size() == before.positions.size() - 1);
    Mesh empty;
    CHECK(removeIslands(empty, {}).kept_pieces == 0);
}
