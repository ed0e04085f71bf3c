// SPDX-License-Identifier: Apache-2.0
#include "core/lens.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

constexpr double kDegree = std::numbers::pi / 180;

Distortion fisheye(double k1 = 0, double k2 = 0, double k3 = 0, double k4 = 0) {
    Distortion lens;
    lens.model = LensModel::fisheye;
    lens.k1 = k1, lens.k2 = k2, lens.k3 = k3, lens.k4 = k4;
    return lens;
}

/// Light at an angle from the axis, towards an azimuth about it.
Vec3d light(double theta, double azimuth) {
    return {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)};
}

/// The greatest angle in radians by which undistort misses the direction that distort was given, over all azimuths and
/// all angles up to `farthest`.
double worstRoundTrip(const Distortion& lens, double farthest) {
    double worst = 0;
    for (int ring = 0; ring <= 100; ++ring)
        for (int i = 0; i < 24; ++i) {
            const Vec3d seen = light(farthest * ring / 100, 0.1 + 2 * std::numbers::pi * i / 24);
            const auto place = distort(lens, seen);
            REQUIRE(place);
            worst = std::max(worst, (undistort(lens, *place).normalized() - seen).norm());
        }
    return worst;
}

}  // namespace

TEST_CASE("the rational model is OpenCV's", "[core]") {
    Distortion lens;
    lens.k1 = 0.1, lens.k2 = 0.2, lens.k3 = 0.3, lens.k4 = 0.4, lens.k5 = 0.5, lens.k6 = 0.6;
    lens.p1 = 0.01, lens.p2 = 0.02;
    // By hand for x = 0.6, y = 0.2 (at depth 2: 0.3, 0.1), r^2 = 0.1:
    // radial = 1.0123 / (1 + 0.04 + 0.005 + 0.0006) = 1.0123 / 1.0456; p as in the model without a denominator.
    const auto place = distort(lens, {0.6, 0.2, 2});
    REQUIRE(place);
    CHECK(place->x() == Approx(0.3 * 1.0123 / 1.0456 + 0.0006 + 0.0056).epsilon(1e-14));
    CHECK(place->y() == Approx(0.1 * 1.0123 / 1.0456 + 0.0012 + 0.0012).epsilon(1e-14));
}

TEST_CASE("the fisheye model is OpenCV's, and goes on behind the sensor's plane", "[core]") {
    // theta = 45 degrees towards (0.6, 0.8): theta_d = theta (1 + 0.1 theta^2 + 0.01 theta^4 - 0.001 theta^6 + ...).
    const double theta = std::numbers::pi / 4, u = theta * theta;
    const double theta_d = theta * (1 + 0.1 * u + 0.01 * u * u - 0.001 * u * u * u + 0.002 * u * u * u * u);
    const auto place = distort(fisheye(0.1, 0.01, -0.001, 0.002), {0.6, 0.8, 1});
    REQUIRE(place);
    CHECK(place->x() == Approx(0.6 * theta_d).epsilon(1e-14));
    CHECK(place->y() == Approx(0.8 * theta_d).epsilon(1e-14));

    CHECK(distort(fisheye(), light(120 * kDegree, 0))->x() == Approx(120 * kDegree).epsilon(1e-14));
    CHECK(undistort(fisheye(), {120 * kDegree, 0}).z() == Approx(-0.5).epsilon(1e-14));
    CHECK(distort(fisheye(), {0, 0, 1}) == Vec2d(0, 0));
    CHECK(undistort(fisheye(), {0, 0}) == Vec3d(0, 0, 1));
    CHECK_FALSE(distort(fisheye(), {0, 0, -1}));  // from everywhere at once
    CHECK_FALSE(distort(fisheye(), {0, 0, 0}));
    CHECK_FALSE(distort({}, light(90 * kDegree + 1e-9, 1)));
    // Next to the axis theta / r is a quotient of two small numbers.
    CHECK(distort(fisheye(0.3), {1e-160, 0, 1})->x() == Approx(1e-160));
    CHECK(undistort(fisheye(0.3), {1e-160, 0}).x() == Approx(1e-160));
}

TEST_CASE("undistort finds the light that distort came from, in every model", "[core]") {
    struct Case {
        Distortion lens;
        double farthest;  // radians
    };
    Distortion rational;  // of a 120 degree lens, whose numerator and denominator nearly cancel
    rational.k1 = 5.1, rational.k2 = 3.2, rational.k3 = 0.12, rational.k4 = 5.4, rational.k5 = 4.9, rational.k6 = 0.8;
    rational.p1 = 1e-4, rational.p2 = -2e-4;
    const std::vector<Case> cases{{{}, 89 * kDegree},
                                  {{-0.25, 0.06, 0, 0.002, -0.001}, 40 * kDegree},
                                  {{0.3, 0.1, 0.05, 0, 0}, 60 * kDegree},
                                  {rational, 60 * kDegree},
                                  {fisheye(), 179 * kDegree},
                                  {fisheye(-0.02, 0.003, -0.001, 0.0001), 110 * kDegree},
                                  {fisheye(0.1, 0.05, 0.01, 0.01), 130 * kDegree},
                                  {fisheye(-0.13), 80 * kDegree}};
    for (const Case& c : cases) {
        CAPTURE(c.lens.k1, c.lens.k4, c.farthest / kDegree);
        // Places and angles of order one carry some 1e-16 each; the steepest lens here magnifies them tenfold.
        CHECK(worstRoundTrip(c.lens, c.farthest) < 1e-14);
    }
}

TEST_CASE("beyond the fold of a lens there is nothing", "[core]") {
    // theta (1 - 0.13 theta^2) turns at theta = 1 / sqrt(0.39) = 1.6013, 91.7 degrees, for good.
    CHECK(distort(fisheye(-0.13), light(1.60, 1)));
    CHECK_FALSE(distort(fisheye(-0.13), light(1.61, 1)));
    CHECK_FALSE(distort(fisheye(-0.13), light(3.0, 1)));
    // theta - 0.6 theta^3 + 0.12 theta^5 falls from 0.858 to 1.505 and rises again: the same place seen twice.
    const Distortion twice = fisheye(-0.6, 0.12);
    CHECK(distort(twice, light(0.85, 2)));
    CHECK_FALSE(distort(twice, light(1.2, 2)));
    CHECK_FALSE(distort(twice, light(1.6, 2)));

    // r / (1 + r^2) turns at r = 1.
    Distortion lens;
    lens.k4 = 1;
    CHECK(distort(lens, {0.99, 0, 1}));
    CHECK_FALSE(distort(lens, {1.01, 0, 1}));
    // r / (1 - r^2) has a pole at r = 1, and comes back from the other side.
    lens.k4 = -1;
    CHECK(distort(lens, {0.99, 0, 1}));
    CHECK_FALSE(distort(lens, {0, 1.01, 1}));
    // x + 3 p2 x^2 turns at x = -1 / (6 p2).
    Distortion tangential;
    tangential.p2 = 0.1;
    CHECK(distort(tangential, {-1.6, 0, 1}));
    CHECK_FALSE(distort(tangential, {-1.7, 0, 1}));
}

TEST_CASE("a place that no light reaches is told by distort", "[core]") {
    for (const Distortion& lens : {fisheye(-0.13), Distortion{-0.25, 0, 0, 0, 0}}) {
        const Vec2d place(5, 5);
        const auto back = distort(lens, undistort(lens, place));
        CHECK((!back || (*back - place).norm() > 1));
    }
    const auto beyond = distort(fisheye(), undistort(fisheye(), {4, 0}));  // 229 degrees off the axis
    CHECK((!beyond || std::abs(beyond->x() - 4) > 0.5));
}
