// SPDX-License-Identifier: Apache-2.0
#include "trainer/view_neighbours.h"

#include <cmath>
#include <numbers>

#include "core/types.h"
#include "tests/support/catch.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;

namespace {

View viewFrom(const Vec3d& eye, const Vec3d& target) {
    View view;
    view.camera = lookAt(eye, target, Vec3d(0, 0, 1), 0.7, 40, 30);
    return view;
}

}  // namespace

TEST_CASE("the nearest view is the one beside it on a walk, whatever the world's unit and place") {
    for (const double unit : {1e-3, 1.0, 1e4}) {
        CAPTURE(unit);
        const Vec3d place = unit * Vec3d(500, -300, 20);
        std::vector<View> walk;  // gaps grow: each but the first is nearest to the one before it
        for (int i = 0; i < 8; ++i) walk.push_back(viewFrom(place + unit * Vec3d(i * i, 0, 0), place + unit * Vec3d(i * i, 50, 0)));
        CHECK(nearestViews(walk) == std::vector<int>{1, 0, 1, 2, 3, 4, 5, 6});
    }
}

TEST_CASE("of cameras in one place those are nearest that look the same way") {
    std::vector<View> turned;
    for (const double degrees : {0.0, 100.0, 90.0, 10.0, 180.0}) {
        const double angle = degrees * std::numbers::pi / 180;
        turned.push_back(viewFrom({1, 2, 3}, {1 + std::cos(angle), 2 + std::sin(angle), 3}));
    }
    CHECK(nearestViews(turned) == std::vector<int>{3, 2, 1, 0, 1});
}

TEST_CASE("on a long walk of a camera that turns about, with one pose far astray, the nearest view is still a near one") {
    std::vector<View> walk;
    for (int i = 0; i < 400; ++i) {
        const double turn = test::randomIn(-0.2f, 0.2f, 71, i);
        walk.push_back(viewFrom(Vec3d(i, 0, 0), Vec3d(i + 20 * std::sin(turn), 20 * std::cos(turn), 0)));
    }
    walk.push_back(viewFrom(Vec3d(0, -1e6, 0), Vec3d(0, 0, 0)));
    const std::vector<int> nearest = nearestViews(walk);
    for (int i = 0; i < 400; ++i) CHECK(std::abs(nearest[i] - i) <= 4);  // 23 degrees to either side are 4 strides
    CHECK(nearest[400] < 400);
}

TEST_CASE("of a pair of cameras on one pole that look apart, the nearest is what looks the same way from the next place") {
    std::vector<View> pairs;
    for (int i = 0; i < 6; ++i) {
        pairs.push_back(viewFrom(Vec3d(i, 0, 0), Vec3d(i, 9, 0)));
        pairs.push_back(viewFrom(Vec3d(i, 0, 0), Vec3d(i, -9, 0)));
    }
    CHECK(nearestViews(pairs) == std::vector<int>{2, 3, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
}

TEST_CASE("back to back in nearly one place is not near") {
    // Around a table: the neighbours on the circle, not the opposite side, nor who stands there and looks away.
    std::vector<View> views{viewFrom({4, 0, 0}, {0, 0, 0}), viewFrom({4.1, 0, 0}, {9, 0, 0}), viewFrom({3.8, 1.2, 0}, {0, 0, 0}),
                            viewFrom({-4, 0, 0}, {0, 0, 0})};
    CHECK(nearestViews(views)[0] == 2);
}

TEST_CASE("a view alone is its own neighbour, and no view has none") {
    CHECK(nearestViews({viewFrom({1, 0, 0}, {0, 0, 0})}) == std::vector<int>{0});
    CHECK(nearestViews({}).empty());
}
