// SPDX-License-Identifier: Apache-2.0
#include "export/mesh.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

Mesh tetrahedron(const Vec3f& at) {
    Mesh mesh;
    mesh.positions = {at, at + Vec3f::UnitX(), at + Vec3f::UnitY(), at + Vec3f::UnitZ()};
    mesh.triangles = {Triangle(0, 2, 1), Triangle(0, 1, 3), Triangle(0, 3, 2), Triangle(1, 2, 3)};
    return mesh;
}

}  // namespace

TEST_CASE("measures of a tetrahedron", "[export]") {
    const MeshMeasures m = measureMesh(tetrahedron(Vec3f(1000, 0, 0)));
    CHECK(m.closed());
    CHECK(m.edges == 6);
    CHECK(m.euler == 2);
    CHECK(m.pieces == 1);
    CHECK(m.degenerate_faces == 0);
    CHECK(m.volume == Approx(1.0 / 6));
    CHECK(m.area == Approx(1.5 + std::sqrt(3.0) / 2));
}

TEST_CASE("defects are counted", "[export]") {
    Mesh open = tetrahedron(Vec3f::Zero());
    open.triangles.pop_back();
    CHECK(measureMesh(open).open_edges == 3);
    CHECK_FALSE(measureMesh(open).closed());

    Mesh flipped = tetrahedron(Vec3f::Zero());
    std::swap(flipped.triangles[3][0], flipped.triangles[3][1]);
    CHECK(measureMesh(flipped).bad_edges == 3);

    Mesh doubled = tetrahedron(Vec3f::Zero());
    doubled.triangles.push_back(doubled.triangles[0]);
    CHECK(measureMesh(doubled).bad_edges == 3);

    Mesh flat = tetrahedron(Vec3f::Zero());
    flat.positions[3] = flat.positions[0];
    CHECK(measureMesh(flat).degenerate_faces == 2);

    Mesh wrong = tetrahedron(Vec3f::Zero());
    wrong.triangles[2][1] = 4;
    CHECK_THROWS_AS(measureMesh(wrong), DataError);
    CHECK(measureMesh(Mesh{}).euler == 0);
}

TEST_CASE("pieces are numbered by their lowest vertex", "[export]") {
    Mesh mesh = tetrahedron(Vec3f::Zero());
    mesh.positions.push_back(Vec3f(9, 9, 9));  // unused
    const Mesh other = tetrahedron(Vec3f(3, 0, 0));
    for (const Vec3f& p : other.positions) mesh.positions.push_back(p);
    for (const Triangle& t : other.triangles) mesh.triangles.push_back(t + Triangle::Constant(5));
    CHECK(piecesOfVertices(mesh) == std::vector<std::uint32_t>{0, 0, 0, 0, 1, 2, 2, 2, 2});
    CHECK(measureMesh(mesh).pieces == 2);
    CHECK(measureMesh(mesh).euler == 4);
}
