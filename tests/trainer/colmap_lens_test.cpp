// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_lens.h"

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/trainer/colmap_scene.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

TEST_CASE("every lens model projects as COLMAP's does", "[trainer]") {
    const std::vector<ColmapCamera> cameras{
        {1, "SIMPLE_PINHOLE", 640, 480, {500, 310, 250}},
        {1, "PINHOLE", 640, 480, {500, 510, 310, 250}},
        {1, "SIMPLE_RADIAL", 640, 480, {500, 310, 250, -0.1}},
        {1, "RADIAL", 640, 480, {500, 310, 250, -0.1, 0.02}},
        {1, "OPENCV", 640, 480, {500, 510, 310, 250, -0.1, 0.02, 0.001, -0.002}},
        {1, "FULL_OPENCV", 640, 480, {500, 510, 310, 250, -0.1, 0.02, 0.001, -0.002, 0.003, 0.01, 0.02, 0.005}},
        {1, "OPENCV_FISHEYE", 640, 480, {300, 310, 310, 250, -0.02, 0.003, 0.001, -0.0005}},
        {1, "SIMPLE_RADIAL_FISHEYE", 640, 480, {300, 310, 250, -0.02}},
        {1, "RADIAL_FISHEYE", 640, 480, {300, 310, 250, -0.02, 0.003}}};
    for (const ColmapCamera& source : cameras) {
        CAPTURE(source.model);
        CHECK(colmapLensModel(source.model, "here").n_parameters == source.parameters.size());
        CHECK(colmapLensModel(colmapLensModel(source.model, "here").id, "here").name == source.model);
        const Camera camera = cameraOf(source, "here");
        CHECK(cameraProblem(camera).empty());
        for (const Vec3d& point : {Vec3d(0.3, -0.2, 1), Vec3d(-0.5, 0.4, 1.1), Vec3d(0.01, 0.3, 0.7)}) {
            const auto pixel = projectPoint(camera, Vec3d(point.x(), -point.y(), -point.z()));  // y up, z backward
            REQUIRE(pixel);
            CHECK((*pixel - colmapPixel(source, point)).norm() < 1e-10);
        }
    }
}

TEST_CASE("sizes that no image has are refused", "[trainer]") {
    for (const std::uint64_t side : {std::uint64_t{0}, std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
        CHECK_THROWS_WITH(cameraOf({1, "PINHOLE", side, 20, {1, 1, 1, 1}}, "cameras.bin: camera 1"),
                          Contains("cameras.bin: camera 1: found images of " + std::to_string(side) + "x20"));
        CHECK_THROWS_AS(cameraOf({1, "PINHOLE", 20, side, {1, 1, 1, 1}}, "here"), DataError);
    }
}
