// SPDX-License-Identifier: Apache-2.0
#include "export/placement.h"

#include <Eigen/LU>
#include <cmath>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using Origin = PlacementOptions::Origin;

namespace {

const Box kBounds{{-1, 2, 3}, {5, 4, 11}};  // middle (2, 3, 7)

}  // namespace

TEST_CASE("without options a scene stays where it is, bit by bit") {
    const Similarity same = placementOf({}, kBounds);
    const Vec3d point(0.1, 1.0 / 3, -7.7);
    CHECK(same.apply(point) == point);
    CHECK(placementOf({.up = UpAxis::z}, kBounds).apply(point) == point);
    CHECK(placementOf({.source_up = UpAxis::y}, kBounds).apply(point) == point);
}

TEST_CASE("up becomes up, and nothing is mirrored") {
    for (const UpAxis from : {UpAxis::y, UpAxis::z})
        for (const UpAxis to : {UpAxis::y, UpAxis::z}) {
            const auto unit = [](UpAxis axis) { return axis == UpAxis::y ? Vec3d::UnitY() : Vec3d::UnitZ(); };
            const Similarity placed = placementOf({.source_up = from, .up = to}, kBounds);
            CHECK(placed.apply(unit(from)) == unit(to));
            CHECK(placed.apply(Vec3d::UnitX()) == Vec3d::UnitX());
            CHECK(placed.rotation.determinant() == 1.0);
        }
    CHECK(placementOf({.up = UpAxis::y}, kBounds).apply(Vec3d(1, 2, 3)) == Vec3d(1, 3, -2));
}

TEST_CASE("the middle, or the middle of the ground, comes to lie in the origin") {
    for (const double scale : {0.01, 1.0, 100.0}) {
        const Similarity middle = placementOf({.scale = scale, .up = UpAxis::y, .origin = Origin::middle}, kBounds);
        CHECK(middle.apply(kBounds.center()).norm() <= 1e-15 * scale * 12);

        for (const UpAxis up : {UpAxis::y, UpAxis::z}) {
            const Similarity ground = placementOf({.scale = scale, .up = up, .origin = Origin::ground}, kBounds);
            CHECK(ground.apply(Vec3d(2, 3, 3)).norm() <= 1e-15 * scale * 12);
            const Vec3d top = ground.apply(Vec3d(2, 3, 11));
            CHECK(top[up == UpAxis::y ? 1 : 2] == Approx(8 * scale));
        }
    }
    // The other way round the lowest corner of the source is the highest of the target's depth, not of its height.
    const Similarity tipped =
        placementOf({.source_up = UpAxis::y, .up = UpAxis::z, .origin = Origin::ground}, kBounds);
    CHECK(tipped.apply(Vec3d(2, 2, 7)).norm() <= 1e-14);
}

TEST_CASE("distances are multiplied by the scale") {
    const Similarity placed = placementOf({.scale = 2.5, .up = UpAxis::y, .origin = Origin::middle}, kBounds);
    const Vec3d a(1, 2, 3), b(-4, 0.5, 9);
    CHECK((placed.apply(a) - placed.apply(b)).norm() == Approx(2.5 * (a - b).norm()));
}

TEST_CASE("placements that are none are refused") {
    for (const double scale : {0.0, -1.0, double{NAN}, double{INFINITY}})
        CHECK_THROWS_AS(placementOf({.scale = scale}, kBounds), UsageError);
    const Box empty{{1, 1, 1}, {0, 0, 0}}, open{{0, 0, 0}, {1, INFINITY, 1}};
    for (const Box& bounds : {empty, open}) {
        CHECK_THROWS_AS(placementOf({.origin = Origin::middle}, bounds), UsageError);
        CHECK_NOTHROW(placementOf({}, bounds));
    }
}
