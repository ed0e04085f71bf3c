// SPDX-License-Identifier: Apache-2.0
#include "export/triangle_tree.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

Vec3d randomPoint(std::uint64_t stream, std::uint64_t index) {
    const auto unit = [&](int axis) {
        return 2 * static_cast<double>(unitFloat(static_cast<std::uint32_t>(randomBits(3, stream, 3 * index + axis)))) -
               1;
    };
    return {unit(0), unit(1), unit(2)};
}

double distanceToSegment(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
    const double length = (b - a).squaredNorm();
    const double t = length > 0 ? std::clamp((p - a).dot(b - a) / length, 0.0, 1.0) : 0;
    return (a + t * (b - a) - p).norm();
}

/// Another way to the same: the plane's foot if it lies inside, else the nearest of the three sides.
double referenceDistance(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const double sides = std::min({distanceToSegment(p, a, b), distanceToSegment(p, b, c), distanceToSegment(p, c, a)});
    const Vec3d normal = (b - a).cross(c - a);
    if (normal.norm() == 0) return sides;
    const auto isLeftOf = [&](const Vec3d& from, const Vec3d& to) {
        return normal.dot((to - from).cross(p - from)) > 0;
    };
    if (isLeftOf(a, b) && isLeftOf(b, c) && isLeftOf(c, a)) return std::abs(normal.normalized().dot(p - a));
    return sides;
}

Mesh triangleSoup(std::size_t n) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < n; ++i) {
        const Vec3d centre = randomPoint(0, i);
        for (std::uint64_t k = 0; k < 3; ++k)
            mesh.positions.push_back((centre + 0.2 * randomPoint(1 + k, i)).cast<float>());
        if (i % 17 == 0) mesh.positions.back() = mesh.positions[3 * i];  // without area
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

}  // namespace

TEST_CASE("the nearest point of a triangle lies inside, on a side or at a corner", "[export]") {
    for (std::uint64_t i = 0; i < 20000; ++i) {
        Vec3d a = randomPoint(10, i), b = randomPoint(11, i), c = randomPoint(12, i);
        if (i % 10 == 1) c = b;
        if (i % 10 == 2) c = 0.5 * (a + b);
        if (i % 10 == 3) b = c = a;
        const Vec3d p = 2 * randomPoint(13, i);
        const Vec3d q = nearestOnTriangle(p, a, b, c);
        INFO(i);
        REQUIRE((q - p).norm() == Approx(referenceDistance(p, a, b, c)).margin(1e-9));
    }
    CHECK(nearestOnTriangle({0.2, 0.2, 5}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}).isApprox(Vec3d(0.2, 0.2, 0)));
    CHECK(nearestOnTriangle({1, 1, 5}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}).isApprox(Vec3d(0.5, 0.5, 0)));
    CHECK(nearestOnTriangle({3, -1, 5}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}).isApprox(Vec3d(1, 0, 0)));
}

TEST_CASE("the tree finds what looking at every triangle finds", "[export]") {
    for (const std::size_t n : {1, 2, 4, 5, 9, 31, 64, 1000}) {
        const Mesh mesh = triangleSoup(n);
        const TriangleTree tree(mesh);
        for (std::uint64_t i = 0; i < 300; ++i) {
            const Vec3d p = 1.5 * randomPoint(20, i);
            double least = std::numeric_limits<double>::infinity();
            const auto distanceOf = [&](std::size_t triangle) {
                const Vec3f* corner = &mesh.positions[3 * triangle];
                return referenceDistance(p, corner[0].cast<double>(), corner[1].cast<double>(),
                                         corner[2].cast<double>());
            };
            for (std::size_t triangle = 0; triangle < n; ++triangle) least = std::min(least, distanceOf(triangle));
            const NearestPoint found = tree.nearest(p);
            INFO(n << " triangles, point " << i);
            REQUIRE(std::sqrt(found.squared_distance) == Approx(least).margin(1e-9));
            REQUIRE(distanceOf(found.triangle) == Approx(least).margin(1e-9));
        }
    }
}

TEST_CASE("triangles that all lie in one place make a tree", "[export]") {
    Mesh mesh = icosphere(0);
    for (int i = 0; i < 1000; ++i) mesh.triangles.push_back(mesh.triangles[0]);
    CHECK(std::sqrt(TriangleTree(mesh).nearest(Vec3d(5, 0, 0)).squared_distance) == Approx(4).epsilon(0.05));
    mesh.triangles[3][1] = 99;
    CHECK_THROWS_AS(TriangleTree(mesh), DataError);
}
