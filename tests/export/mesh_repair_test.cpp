// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_repair.h"

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/meshing.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

Mesh tetrahedron(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d) {
    Mesh mesh;
    mesh.positions = {a, b, c, d};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    return mesh;
}

/// Names vertices at the same place by the first of them.
void weld(Mesh& mesh) {
    for (Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k)
            t[k] = static_cast<std::uint32_t>(
                std::find(mesh.positions.begin(), mesh.positions.end(), mesh.positions[t[k]]) - mesh.positions.begin());
}

void checkManifold(const Mesh& mesh) {
    CHECK(measureMesh(mesh).closed());
    CHECK(isVertexManifold(mesh));
    CHECK(nonManifoldVertices(mesh).empty());
}

}  // namespace

TEST_CASE("a manifold stays as it is", "[export]") {
    Mesh mesh = icosphere(2);
    const Mesh before = mesh;
    CHECK(nonManifoldVertices(mesh).empty());
    CHECK_FALSE(makeManifold(mesh).any());
    CHECK(mesh.positions == before.positions);
    CHECK(mesh.triangles == before.triangles);
}

TEST_CASE("solids that touch in an edge come apart as they are, not through each other", "[export]") {
    const Vec3f a(0, 0, 0), b(0, 0, 1);
    Mesh mesh = tetrahedron(a, Vec3f(1, 0.2f, 0), Vec3f(1, 1, 0), b);
    const double volume = 2 * measureMesh(mesh).volume;
    REQUIRE(volume > 0);
    append(mesh, tetrahedron(a, Vec3f(-1, -0.2f, 0), Vec3f(-1, -1, 0), b));
    mesh.normals.assign(mesh.positions.size(), Vec3f::UnitX());
    weld(mesh);
    CHECK(measureMesh(mesh).bad_edges == 1);
    CHECK(nonManifoldVertices(mesh) == std::vector<std::uint32_t>{0, 3});
    CHECK(makeManifold(mesh).added_vertices == 2);
    checkManifold(mesh);
    CHECK(measureMesh(mesh).pieces == 2);
    CHECK(measureMesh(mesh).volume == Approx(volume));
    CHECK(mesh.normals.size() == mesh.positions.size());
    for (const std::uint32_t piece : {0u, 1u}) {  // each has all its vertices on its side
        const std::vector<std::uint32_t> pieces = piecesOfVertices(mesh);
        float low = 0, high = 0;
        for (std::size_t v = 0; v < pieces.size(); ++v)
            if (pieces[v] == piece) {
                low = std::min(low, mesh.positions[v].x());
                high = std::max(high, mesh.positions[v].x());
            }
        CHECK(low * high == 0);
    }
}

TEST_CASE("solids that touch in a vertex come apart", "[export]") {
    Mesh mesh = tetrahedron({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    append(mesh, tetrahedron({0, 0, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, 1.5f}));
    weld(mesh);
    CHECK(nonManifoldVertices(mesh) == std::vector<std::uint32_t>{0});
    CHECK(makeManifold(mesh).added_vertices == 1);
    checkManifold(mesh);
}

TEST_CASE("triangles that lie on their opposites go, flaps and lone ones alike", "[export]") {
    Mesh mesh = icosphere(1);
    const std::size_t faces = mesh.triangles.size();
    const std::uint32_t n = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {{2, 0, 0}, {3, 0, 0}, {3, 1, 0}});
    mesh.normals.insert(mesh.normals.end(), 3, Vec3f::UnitX());
    mesh.triangles.push_back({0, 1, n});  // a flap on two vertices of the sphere
    mesh.triangles.push_back({n, 1, 0});
    mesh.triangles.push_back({n, n + 1, n + 2});
    mesh.triangles.push_back({n + 1, n, n + 2});
    mesh.triangles.push_back({n, n, n + 2});
    const std::vector<std::uint32_t> faults = nonManifoldVertices(mesh);
    CHECK(std::find(faults.begin(), faults.end(), n + 1) != faults.end());
    CHECK(makeManifold(mesh).dropped_faces == 5);
    checkManifold(mesh);
    CHECK(mesh.triangles.size() == faces);
    CHECK(measureMesh(mesh).euler == 2);
}

TEST_CASE("a ring pinched to a loop of two edges stays a ring", "[export]") {
    // A torus of two segments: the edges between its two circles exist twice.
    Mesh mesh = torus(2, 5, 2, 0.5f);
    REQUIRE(measureMesh(mesh).bad_edges > 0);
    CHECK(makeManifold(mesh).added_vertices > 0);
    CHECK(measureMesh(mesh).closed());
    CHECK(isVertexManifold(mesh));
}

TEST_CASE("whatever collapses, the result is closed and manifold", "[export]") {
    const Mesh shapes[] = {icosphere(2), torus(24, 10, 2, 0.6f), torus(40, 4, 2, 0.1f)};
    for (std::uint64_t trial = 0; trial < 60; ++trial) {
        Mesh mesh = shapes[trial % 3];
        // Merge vertices at random along edges, as bad a simplifier as can be.
        for (std::uint64_t i = 0; i < 20 + trial * 4; ++i) {
            const Triangle t = mesh.triangles[randomBits(5, trial, i) % mesh.triangles.size()];
            for (Triangle& other : mesh.triangles)
                for (int k = 0; k < 3; ++k)
                    if (other[k] == t[0]) other[k] = t[1];
        }
        const double volume = measureMesh(mesh).volume;
        makeManifold(mesh);
        INFO(trial);
        checkManifold(mesh);
        CHECK(measureMesh(mesh).volume == Approx(volume).margin(1e-5));
    }
}

TEST_CASE("open edges stay open, and no vertex is invented", "[export]") {
    Mesh mesh = icosphere(1);
    mesh.triangles.pop_back();
    CHECK(nonManifoldVertices(mesh).empty());
    CHECK_FALSE(makeManifold(mesh).any());
    CHECK(measureMesh(mesh).open_edges == 3);
    mesh.triangles[0][0] = 1000;
    CHECK_THROWS_AS(makeManifold(mesh), DataError);
}
