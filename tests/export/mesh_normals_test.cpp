// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_normals.h"

#include "tests/support/catch.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

TEST_CASE("a cube's corner looks along its diagonal, however its faces are cut", "[export]") {
    // At corner 0 one face has two triangles, the others one: by area or by number it would win.
    Mesh mesh;
    for (int i = 0; i < 8; ++i) mesh.positions.push_back(Vec3f(i & 1, i >> 1 & 1, i >> 2));
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 2}, {4, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    REQUIRE(measureMesh(mesh).closed());
    REQUIRE(measureMesh(mesh).volume == Approx(1));
    mesh.positions.push_back(Vec3f(5, 5, 5));  // no triangle has it
    computeNormals(mesh, VertexFaces(mesh));
    for (int i = 0; i < 8; ++i) {
        const Vec3f diagonal = (mesh.positions[i] - Vec3f::Constant(0.5f)).normalized();
        INFO(i);
        CHECK((mesh.normals[i] - diagonal).norm() < 1e-6f);
    }
    CHECK(mesh.normals[8] == Vec3f::UnitZ());
}

TEST_CASE("normals of a fine sphere are those of the sphere", "[export]") {
    Mesh mesh = icosphere(4);
    const std::vector<Vec3f> exact = mesh.normals;
    computeNormals(mesh, VertexFaces(mesh));
    float worst = 1;
    for (std::size_t v = 0; v < exact.size(); ++v) worst = std::min(worst, exact[v].dot(mesh.normals[v]));
    CHECK(worst > 0.9999f);  // edges of 0.07: an error of 0.01 rad at most, 0.02 would be 0.9998
}
