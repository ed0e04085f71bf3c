// SPDX-License-Identifier: Apache-2.0
#include "trainer/scene_box.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"

namespace nerfvdb {
namespace {

Dataset lookingAt(const Vec3d& target, const std::vector<Vec3d>& eyes) {
    Dataset dataset;
    for (const Vec3d& eye : eyes) {
        View view;
        view.camera = lookAt(eye, target, Vec3d::UnitZ(), 0.7, 64, 64);
        dataset.views.push_back(view);
    }
    return dataset;
}

}  // namespace

TEST_CASE("the common focus is where all axes meet; of parallel axes, the middle of the cameras") {
    const Vec3d target(1, 2, 3);
    const Dataset meeting = lookingAt(target, {{9, 2, 3}, {1, 12, 4}, {1, -7, 3}, {-4, 4, 1}});
    CHECK((commonFocus(meeting) - target).norm() < 1e-9);

    Dataset parallel;
    for (const double x : {0.0, 2.0, 7.0}) {
        View view;
        view.camera = lookAt({x, 0, 0}, {x, 5, 0}, Vec3d::UnitZ(), 0.7, 64, 64);
        parallel.views.push_back(view);
    }
    CHECK((commonFocus(parallel) - Vec3d(3, 0, 0)).norm() < 1e-9);
}

TEST_CASE("a given box goes before all, and one that is none is refused") {
    const Dataset dataset = lookingAt(Vec3d::Zero(), {{4, 0, 0}, {0, 4, 0}});
    const Box given{Vec3d(-1, -2, -3), Vec3d(4, 5, 6)};
    CHECK(findSceneBox(dataset, given).min == given.min);
    CHECK(findSceneBox(dataset, given).max == given.max);
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    for (const Box& wrong : {Box{Vec3d(0, 0, 0), Vec3d(1, 1, 0)}, Box{Vec3d(0, 0, 0), Vec3d(1, -1, 1)},
                             Box{Vec3d(0, nan, 0), Vec3d(1, 1, 1)}, Box{Vec3d(0, 0, 0), Vec3d(1, infinity, 1)}})
        CHECK_THROWS_WITH(findSceneBox(dataset, wrong), Catch::Contains("--bounds"));
}

TEST_CASE("without alpha the box reaches to the farthest camera; aabb_scale says otherwise") {
    Dataset dataset = lookingAt(Vec3d::Zero(), {{4, 0, 0}, {0, 6, 0}, {0, 0.1, 5}});
    CHECK(findSceneBox(dataset, {}).size().maxCoeff() == Approx(12).epsilon(1e-6));
    dataset.aabb_scale = 4;
    CHECK(findSceneBox(dataset, {}).size().maxCoeff() == Approx(4 / 0.33));
}

TEST_CASE("the common view is what half of the cameras see whole") {
    // Each sees 2 * 4 tan(0.35) = 2.9 of the middle's plane, and the whole depth of the search, so any two of the three share
    // the middle and a little of where they overlap behind and before it.
    const Box box = findCommonView(lookingAt(Vec3d::Zero(), {{4, 0, 0}, {0, 4, 0}, {0, 0.1, 4}}));
    CHECK(box.min.maxCoeff() < -1.2);
    CHECK(box.max.minCoeff() > 1.2);
    CHECK(box.size().maxCoeff() < 4.4);
}

TEST_CASE("where cameras share no view, it reaches to the farthest of them") {
    Dataset dataset;
    for (const double side : {1.0, -1.0}) {
        View view;
        view.camera = lookAt({2 * side, 0, 0}, {9 * side, side, 0}, Vec3d::UnitZ(), 0.7, 64, 64);
        dataset.views.push_back(view);
        view.camera = lookAt({0, 3 * side, 0}, {side, 9 * side, 0}, Vec3d::UnitZ(), 0.7, 64, 64);
        dataset.views.push_back(view);
    }
    const Box box = findCommonView(dataset);
    const Vec3d focus = commonFocus(dataset);
    double farthest = 0;
    for (const View& view : dataset.views) farthest = std::max(farthest, (view.camera.position - focus).norm());
    CHECK((box.max - focus - Vec3d::Constant(farthest)).norm() < 1e-9);
    CHECK((focus - box.min - Vec3d::Constant(farthest)).norm() < 1e-9);
}

TEST_CASE("alpha masks tell where the object is to within a few cells of the search") {
    const Box box = findSceneBox(test::surroundedSphereDataset(24, 64), {});
    const auto scene = makeSyntheticScene("sphere");
    double radius = 0;  // of what is not empty, along x
    while (radius < 2 && scene->density(Vec3d(radius, 0, 0)) > 0) radius += 0.001;
    REQUIRE(radius < 2);
    CHECK(box.max.minCoeff() >= radius);
    CHECK(box.max.maxCoeff() < 1.3 * radius);
    CHECK(box.min.maxCoeff() <= -radius);
    CHECK(box.min.minCoeff() > -1.3 * radius);
}

TEST_CASE("masks that agree on nothing are named") {
    Dataset dataset = test::surroundedSphereDataset(8, 32);
    for (View& view : dataset.views)
        for (auto& pixel : view.photo.pixels) pixel[3] = 0;
    CHECK_THROWS_WITH(findSceneBox(dataset, {}), Catch::Contains("agree on no point of space"));
}

}  // namespace nerfvdb
