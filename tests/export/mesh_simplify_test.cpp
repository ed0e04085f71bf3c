// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_simplify.h"

#include <set>
#include <tuple>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"
#include "tests/support/shell_model.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

TEST_CASE("a sphere with a sixteenth of its triangles is still the sphere", "[export]") {
    Mesh mesh = icosphere(6);
    mesh.colours.assign(mesh.positions.size(), Rgb8(1, 2, 3));
    std::set<std::tuple<float, float, float>> known;
    for (const Vec3f& p : mesh.positions) known.insert({p.x(), p.y(), p.z()});
    const double volume = measureMesh(mesh).volume;
    const std::size_t n = mesh.triangles.size() / 16;
    simplifyMesh(mesh, n);
    CHECK(mesh.triangles.size() == Approx(n).epsilon(0.01));
    const MeshMeasures m = measureMesh(mesh);
    CHECK(m.closed());
    CHECK(isVertexManifold(mesh));
    CHECK(m.euler == 2);
    CHECK(m.degenerate_faces == 0);
    CHECK(m.volume == Approx(volume).epsilon(5e-3));
    REQUIRE(mesh.normals.size() == mesh.positions.size());
    REQUIRE(mesh.colours.size() == mesh.positions.size());
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3f& p = mesh.positions[v];
        REQUIRE(known.count({p.x(), p.y(), p.z()}) == 1);
        REQUIRE((mesh.normals[v] - p).norm() < 1e-6f);
    }
}

TEST_CASE("flat parts cost next to nothing", "[export]") {
    // A box of 16^3 voxels: six planes; its rounded rim needs the triangles that are left.
    const Model model = [] {
        Model m = modelOf(
            makeTopology(Vec3i::Constant(32), Vec3i::Zero(), Vec3i::Constant(31), [](const Vec3i&) { return true; }));
        setDensity(m.field, [](const Vec3i& ijk) { return ijk.minCoeff() >= 8 && ijk.maxCoeff() < 24 ? 1.0f : -1.0f; });
        return m;
    }();
    Mesh mesh = extract(model);
    const MeshMeasures before = measureMesh(mesh);
    simplifyMesh(mesh, mesh.triangles.size() / 8);
    const MeshMeasures m = measureMesh(mesh);
    CHECK(m.closed());
    CHECK(m.euler == 2);
    CHECK(m.volume == Approx(before.volume).epsilon(1e-4));
    CHECK(m.area == Approx(before.area).epsilon(1e-3));
}

TEST_CASE("pieces and tunnels survive while there is room for them", "[export]") {
    Mesh mesh = torus(160, 64, 2, 0.7f);
    for (int i = 0; i < 12; ++i) append(mesh, torus(40, 8, 0.3f, 0.02f));
    // Each small ring to a place of its own.
    for (std::size_t v = 160 * 64; v < mesh.positions.size(); ++v)
        mesh.positions[v] += Vec3f(5 + static_cast<float>((v - 160 * 64) / 320), 0, 0);
    const MeshMeasures before = measureMesh(mesh);
    REQUIRE(before.pieces == 13);
    REQUIRE(before.euler == 0);
    // The rings are thinner than what the large one loses: by error alone they would go first.
    simplifyMesh(mesh, mesh.triangles.size() / 12);
    const MeshMeasures m = measureMesh(mesh);
    CHECK(m.closed());
    CHECK(isVertexManifold(mesh));
    CHECK(m.pieces == 13);
    CHECK(m.euler == 0);
}

TEST_CASE("a surface full of noise stays closed however few triangles are asked for", "[export]") {
    const Model model = shellModel(40);
    Mesh noisy;
    {
        Report silent;
        noisy = extractSurface(model, {.iso = 40.0, .colours = false}, silent);
    }
    REQUIRE(measureMesh(noisy).pieces > 100);
    for (const double share : {0.5, 0.2, 0.05, 0.01, 0.001}) {
        Mesh mesh = noisy;
        const auto n = static_cast<std::size_t>(share * static_cast<double>(noisy.triangles.size()));
        simplifyMesh(mesh, n);
        INFO(share);
        CHECK(measureMesh(mesh).closed());
        CHECK(isVertexManifold(mesh));
        CHECK(mesh.normals.size() == mesh.positions.size());
        CHECK(mesh.triangles.size() >= kFewestFaces);
        if (share >= 0.05) CHECK(mesh.triangles.size() == Approx(n).epsilon(0.02));
    }
}

TEST_CASE("a mesh that is small enough stays, and no mesh has fewer than four triangles", "[export]") {
    Mesh mesh = icosphere(1);
    const std::vector<Triangle> before = mesh.triangles;
    simplifyMesh(mesh, 80);
    CHECK(mesh.triangles == before);
    CHECK_THROWS_AS(simplifyMesh(mesh, 3), NumericError);
    CHECK_THROWS_WITH(simplifyMesh(mesh, 0), Catch::Contains("0 faces") && Catch::Contains("at least 4"));
    simplifyMesh(mesh, 4);
    CHECK(measureMesh(mesh).closed());
    CHECK(mesh.triangles.size() >= 4);
    Mesh none;
    simplifyMesh(none, 100);
    CHECK(none.triangles.empty());
}
