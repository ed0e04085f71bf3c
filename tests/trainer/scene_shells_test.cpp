// SPDX-License-Identifier: Apache-2.0
#include "trainer/scene_shells.h"

#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

namespace nerfvdb {
namespace {

/// Numbers in [0, 1) one after the other.
struct Numbers {
    std::uint64_t next = 0;
    double operator()() { return unitFloat(static_cast<std::uint32_t>(randomBits(7, 0, next++))); }
};

constexpr double kFieldOfView = 60.0 * std::numbers::pi / 180.0;

void addCamera(Dataset& dataset, const Vec3d& eye, const Vec3d& target, const Vec3d& up) {
    View view;
    view.camera = lookAt(eye, target, up, kFieldOfView, 400, 300);
    dataset.views.push_back(view);
}

/// A survey: 8 rows of 12 photographs from 100 m above flat ground, which overlap by three quarters and by half, not
/// quite straight down.
Dataset survey() {
    const double tall = 2 * 100 * std::tan(kFieldOfView / 2), wide = tall * 4 / 3;
    Dataset dataset;
    for (int row = 0; row < 8; ++row)
        for (int n = 0; n < 12; ++n) {
            const Vec3d eye(0.5 * wide * row, 0.25 * tall * n, 100);
            const double x = 3 * std::sin(5 * n + row), y = 3 * std::cos(3 * n - row);
            addCamera(dataset, eye, eye + Vec3d(x, y, -100), Vec3d::UnitY());
        }
    return dataset;
}

/// Along a street: left, right and ahead at each place.
Dataset walk() {
    Dataset dataset;
    for (double x = 0; x <= 50; x += 2.5)
        for (const Vec3d& towards : {Vec3d(0, 1, 0), Vec3d(0, -1, 0), Vec3d(1, 0, 0)})
            addCamera(dataset, Vec3d(x, 0, 1.7), Vec3d(x, 0, 1.7) + towards, Vec3d::UnitZ());
    return dataset;
}

Dataset ring(double radius) {
    Dataset dataset;
    for (int n = 0; n < 24; ++n) {
        const double around = 2 * std::numbers::pi * n / 24;
        addCamera(dataset, Vec3d(radius * std::cos(around), radius * std::sin(around), 2), Vec3d::Zero(), Vec3d::UnitZ());
    }
    return dataset;
}

bool contains(const Box& box, const Vec3d& point) {
    return (point.array() >= box.min.array()).all() && (point.array() <= box.max.array()).all();
}

}  // namespace

TEST_CASE("Cameras around something have a box around it, half as large as they are far away") {
    const SceneShells scene = findSceneShells(ring(6), {});
    REQUIRE(scene.inner.center().norm() < 0.01);
    REQUIRE(scene.inner.size().maxCoeff() == Approx(std::hypot(6, 2)).epsilon(1e-3));
    REQUIRE(scene.inner.size().minCoeff() == Approx(std::hypot(6, 2)).epsilon(1e-3));
    REQUIRE(scene.count > 1);
}

TEST_CASE("Sparse points do not move the box of cameras that look at something in their middle") {
    Dataset dataset = ring(6);
    const Box without = findSceneShells(dataset, {}).inner;
    for (int n = 0; n < 500; ++n) dataset.points.emplace_back(20 * std::sin(n), 20 * std::cos(n), 0);
    REQUIRE(findSceneShells(dataset, {}).inner.min == without.min);
    REQUIRE(findSceneShells(dataset, {}).inner.max == without.max);
}

TEST_CASE("A survey without points has the ground in its box: its photographs overlap as surveys' do") {
    const Dataset dataset = survey();
    // Half the rows' overlap and three quarters along them are eight photographs of a point, not ten.
    REQUIRE(distanceAhead(dataset, -Vec3d::UnitZ()) == Approx(100).epsilon(0.25));
    const Box box = findSceneShells(dataset, {}).inner;
    REQUIRE(contains(box, Vec3d(200, 100, 0)));
    REQUIRE(box.size().maxCoeff() < 700);  // 540 m of ground
}

TEST_CASE("Of a single strip of photographs, too, it is told how far away the ground is") {
    Dataset dataset;
    const double tall = 2 * 100 * std::tan(kFieldOfView / 2);
    for (int n = 0; n < 30; ++n) {
        const Vec3d eye(0, 0.25 * tall * n, 100);
        addCamera(dataset, eye, eye - Vec3d(0, 0, 100), Vec3d::UnitY());
    }
    REQUIRE(distanceAhead(dataset, -Vec3d::UnitZ()) == Approx(100).epsilon(0.25));
}

TEST_CASE("A survey's points give it a box around the ground, without the air above") {
    Dataset dataset = survey();
    Numbers random;
    for (int n = 0; n < 3000; ++n)
        dataset.points.emplace_back(500 * random(), 300 * random(), 10 * random());
    for (int n = 0; n < 20; ++n) dataset.points.emplace_back(250, 150, -1e4 * random());  // wrong matches
    const Box box = findSceneShells(dataset, {}).inner;
    REQUIRE(contains(box, Vec3d(20, 20, 0)));
    REQUIRE(contains(box, Vec3d(480, 280, 10)));
    REQUIRE(box.max.z() < 60);
    REQUIRE(box.min.z() > -60);
    REQUIRE(box.size().maxCoeff() < 600);
}

TEST_CASE("Of points near and far, the box is around the near ones: voxels may grow with the distance, as pixels do") {
    Dataset dataset = walk();
    Numbers random;
    for (int n = 0; n < 2000; ++n)  // both sides of the street
        dataset.points.emplace_back(50 * random(), n % 2 ? 6 : -6, 8 * random());
    for (int n = 0; n < 600; ++n)  // hills
        dataset.points.emplace_back(3000, 1000 * random() - 500, 200 * random());
    const Box box = findSceneShells(dataset, {}).inner;
    REQUIRE(contains(box, Vec3d(25, 6, 1)));
    REQUIRE(contains(box, Vec3d(25, -6, 1)));
    REQUIRE(box.size().maxCoeff() < 100);
    REQUIRE(box.size().maxCoeff() > 45);
}

TEST_CASE("Without points, those who walk about have a box around themselves") {
    const Box box = findSceneShells(walk(), {}).inner;
    REQUIRE(contains(box, Vec3d(0, 0, 1.7)));
    REQUIRE(contains(box, Vec3d(50, 0, 1.7)));
    REQUIRE(box.size().maxCoeff() == Approx(60));
}

TEST_CASE("Few points are no reason, and bounds go before all") {
    Dataset dataset = walk();
    const Box without = findSceneShells(dataset, {}).inner;
    for (int n = 0; n < 50; ++n) dataset.points.emplace_back(n, 6, n % 5);
    REQUIRE_FALSE(boxOfPoints(dataset));
    REQUIRE(findSceneShells(dataset, {}).inner.min == without.min);
    const Box given{Vec3d(1, 2, 3), Vec3d(4, 6, 8)};
    REQUIRE(findSceneShells(dataset, given).inner.min == given.min);
    REQUIRE(findSceneShells(dataset, given).inner.max == given.max);
}

TEST_CASE("Cameras at one place have no box, and a sentence says so") {
    Dataset dataset;
    dataset.root = "turning";
    for (const Vec3d& towards : {Vec3d(0, 1, 0), Vec3d(0, -1, 0), Vec3d(1, 0, 0)})
        addCamera(dataset, Vec3d(1, 1, 1), Vec3d(1, 1, 1) + towards, Vec3d::UnitZ());
    REQUIRE_THROWS_WITH(findSceneShells(dataset, {}), Catch::Matchers::Contains("all stand at one place"));
}

}  // namespace nerfvdb
