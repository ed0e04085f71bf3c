// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_plan.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Cameras along a street: x from 0 to 100, one a metre, eyes at 1.6.
Dataset walk() {
    Dataset dataset;
    dataset.root = "street";
    for (int x = 0; x <= 100; ++x) {
        const Vec3d eye(x, x % 2 ? 0.5 : -0.5, 1.6 + 0.01 * (x % 3));
        View view;
        view.camera = lookAt(eye, eye + Vec3d(1, 0.5 * (x % 5 - 2), 0), Vec3d::UnitZ(), 1.0, 64, 48);
        dataset.views.push_back(view);
    }
    return dataset;
}

}  // namespace

TEST_CASE("a walk is cut along the ground, and every photograph is somebody's", "[trainer]") {
    const Dataset dataset = walk();
    const BlockGrid grid = planBlocks(dataset, 4, 1, std::nullopt);
    CHECK(grid.up == 2);
    CHECK(grid.region().min.x() == Approx(0).margin(1e-9));
    CHECK(grid.region().max.x() == Approx(100));
    CHECK(grid.region().size().y() > 10);  // along which nothing is cut: houses to both sides
    for (const View& view : dataset.views) {
        int takers = 0;
        for (const BlockId& block : grid.blocks()) takers += grid.takesCameraAt(block, view.camera.position);
        CHECK(takers >= 1);
        CHECK(takers <= 2);
    }
    const std::vector<std::size_t> views = viewsOfBlocks(grid, dataset);
    REQUIRE(views.size() == 4);
    for (const std::size_t n : views) {
        CHECK(n >= 25);  // a quarter, and what neighbours share
        CHECK(n < 60);
    }
}

TEST_CASE("bounds say what is cut; up is where cameras are least apart", "[trainer]") {
    Dataset dataset = walk();
    Mat3d turn;  // the same walk with y up
    turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    for (View& view : dataset.views) {
        view.camera.position = turn * view.camera.position;
        view.camera.world_from_camera = turn * view.camera.world_from_camera;
    }
    CHECK(planBlocks(dataset, 2, 1, std::nullopt).up == 1);
    const BlockGrid grid = planBlocks(dataset, 2, 3, Box{{10, 0, -6}, {30, 4, 6}});
    CHECK(grid.region().min.x() == Approx(10).margin(2));
    CHECK(grid.region().max.x() == Approx(30).margin(2));
    CHECK(grid.axisOfRows() == 2);
}

TEST_CASE("nothing can be planned without a camera", "[trainer]") {
    CHECK_THROWS_AS(planBlocks(Dataset{}, 2, 2, std::nullopt), DataError);
    Dataset line = walk();
    for (View& view : line.views) view.camera.position.y() = 0;
    CHECK_THROWS_WITH(planBlocks(line, 2, 2, std::nullopt), Catch::Contains("along"));
}
