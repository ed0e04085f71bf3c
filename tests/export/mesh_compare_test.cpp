// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_compare.h"

#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

/// n x n squares of [0, size]^2 at a height, in triangles.
Mesh plane(float height, float size = 1, std::uint32_t n = 8) {
    Mesh mesh;
    for (std::uint32_t i = 0; i <= n; ++i)
        for (std::uint32_t j = 0; j <= n; ++j)
            mesh.positions.push_back({size * static_cast<float>(i) / static_cast<float>(n),
                                      size * static_cast<float>(j) / static_cast<float>(n), height});
    for (std::uint32_t i = 0; i < n; ++i)
        for (std::uint32_t j = 0; j < n; ++j) {
            const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
            mesh.triangles.push_back({a, b, b + 1});
            mesh.triangles.push_back({a, b + 1, a + 1});
        }
    return mesh;
}

}  // namespace

TEST_CASE("a plane and its copy a step away", "[export]") {
    const MeshComparison near = compareMeshes(plane(0.25f), plane(0), {.threshold = 0.3, .samples = 5000});
    for (const SurfaceDistances& d : {near.accuracy, near.completeness}) {
        CHECK(d.mean == Approx(0.25));
        CHECK(d.percentile_95 == Approx(0.25));
        CHECK(d.largest == Approx(0.25));
        CHECK(d.within == 1);
        CHECK(d.normal_dot == Approx(1));
    }
    CHECK(near.chamfer() == Approx(0.25));
    CHECK(near.fScore() == 1);
    CHECK(near.normalConsistency() == Approx(1));
    CHECK(compareMeshes(plane(0.25f), plane(0), {.threshold = 0.2, .samples = 500}).fScore() == 0);
}

TEST_CASE("half of a plane is accurate and not complete", "[export]") {
    // The truth is four times as large: of its points three quarters are missing. Beyond the corner square, at
    // (x, y) in units of its side, the distance is that to the square [0, 1]^2.
    const MeshComparison c = compareMeshes(plane(0), plane(0, 2), {.threshold = 0.5, .samples = 100000});
    CHECK(c.accuracy.mean == Approx(0).margin(1e-7));
    CHECK(c.accuracy.within == 1);
    // Mean over [0,2]^2: two strips with mean 1/2 and a corner with that of r over a unit square, 0.7652.
    CHECK(c.completeness.mean == Approx((0 + 2 * 0.5 + 0.7652) / 4).epsilon(2e-3));
    // Within 1/2: the square, two strips of half, a quarter disc of radius 1/2.
    CHECK(c.completeness.within == Approx((1 + 2 * 0.5 + std::numbers::pi / 16) / 4).epsilon(2e-3));
    CHECK(c.fScore() == Approx(2 * c.completeness.within / (1 + c.completeness.within)));
    CHECK(c.chamfer() == Approx(0.5 * c.completeness.mean).margin(1e-6));
    // 1 - 0.95 = 0.05 of the area 4 lies beyond the percentile: the corner square less what is nearer.
    CHECK(c.completeness.largest == Approx(std::sqrt(2.0)).epsilon(0.01));
    CHECK(c.completeness.percentile_95 > 1.0);
    CHECK(c.completeness.percentile_95 < 1.2);
}

TEST_CASE("spheres about one centre", "[export]") {
    const Mesh inner = icosphere(5), outer = icosphere(5, 1.1f);
    const MeshComparison c = compareMeshes(outer, inner, {.threshold = 0.2, .samples = 20000});
    // Facets lie up to 1 - cos(0.02) = 2e-4 inside of their sphere.
    CHECK(c.accuracy.mean == Approx(0.1).margin(3e-4));
    CHECK(c.completeness.mean == Approx(0.1).margin(3e-4));
    CHECK(c.accuracy.largest < 0.1005);
    CHECK(c.normalConsistency() > 0.999);

    Mesh turned = inner;
    for (Triangle& t : turned.triangles) std::swap(t[0], t[1]);
    const MeshComparison same = compareMeshes(turned, inner, {.threshold = 1e-3, .samples = 2000});
    CHECK(same.chamfer() < 1e-7);
    CHECK(same.normalConsistency() == Approx(1));  // the sign has no say
}

TEST_CASE("points are even by area, whatever the triangles are", "[export]") {
    // One half of a plane is cut a thousand times finer than the other; the truth covers the coarse half.
    Mesh mesh = plane(0, 1, 1);
    Mesh fine = plane(0, 1, 32);
    for (Vec3f& p : fine.positions) p.x() += 1;
    append(mesh, fine);
    const MeshComparison c = compareMeshes(mesh, plane(0, 1, 3), {.threshold = 1e-4, .samples = 20000});
    CHECK(c.accuracy.within == Approx(0.5).margin(2e-4));
    CHECK(c.accuracy.mean == Approx(0.25).margin(2e-4));
}

TEST_CASE("points are even inside of a triangle", "[export]") {
    Mesh triangle, wall = plane(0, 1, 1);
    triangle.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.triangles = {{0, 1, 2}};
    for (Vec3f& p : wall.positions) p = Vec3f(0, p.y(), p.x() - 0.5f);  // the plane x = 0: the distance is x
    const MeshComparison c = compareMeshes(triangle, wall, {.threshold = 0.5, .samples = 100000});
    CHECK(c.accuracy.mean == Approx(1.0 / 3).epsilon(0.01));
    CHECK(c.accuracy.within == Approx(0.75).epsilon(0.01));
    CHECK(c.accuracy.percentile_95 == Approx(1 - std::sqrt(0.05)).epsilon(0.01));
    CHECK(c.normalConsistency() == Approx(0).margin(1e-9));
}

TEST_CASE("comparing is the same on any number of threads", "[export]") {
    const Mesh a = torus(60, 20, 1, 0.3f), b = torus(50, 24, 1.01f, 0.3f);
    const auto compare = [&](int threads) {
        const ThreadLimit limit(threads);
        return compareMeshes(a, b, {.threshold = 0.01, .samples = 30000});
    };
    const MeshComparison one = compare(1), many = compare(4);
    CHECK(std::memcmp(&one, &many, sizeof one) == 0);
    CHECK(one.accuracy.mean > 0);
}

TEST_CASE("what cannot be compared is said", "[export]") {
    const Mesh good = icosphere(1);
    Mesh flat = good;
    for (Vec3f& p : flat.positions) p = Vec3f::Zero();
    CHECK_THROWS_WITH(compareMeshes(flat, good, {.threshold = 1}), Catch::Contains("the mesh"));
    CHECK_THROWS_WITH(compareMeshes(good, Mesh{}, {.threshold = 1}), Catch::Contains("the truth"));
    CHECK_THROWS_AS(compareMeshes(good, flat, {.threshold = 1}), DataError);
    CHECK_THROWS_AS(compareMeshes(good, good, {.threshold = 0}), UsageError);
    CHECK_THROWS_AS(compareMeshes(good, good, {.threshold = 1, .samples = 0}), UsageError);
}
