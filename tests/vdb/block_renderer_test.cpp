// SPDX-License-Identifier: Apache-2.0
#include "vdb/block_renderer.h"

#include <cmath>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

RenderedImage picture(float rgb, float opacity, float depth, const Vec3f& normal) {
    RenderedImage made{Image(2, 1, 3), Image(2, 1, 1), Image(2, 1, 1), Image(2, 1, 3), {}};
    for (int x = 0; x < 2; ++x) {
        for (int c = 0; c < 3; ++c) {
            made.rgb.at(x, 0)[c] = rgb;
            made.normal.at(x, 0)[c] = normal[c];
        }
        *made.opacity.at(x, 0) = opacity;
        *made.depth.at(x, 0) = depth;
    }
    made.counters.rays = 2;
    return made;
}

}  // namespace

TEST_CASE("pictures of blocks are blended by weight, places also by opacity", "[vdb]") {
    const std::vector<RenderedImage> pictures = {picture(0.2f, 0.5f, 4, Vec3f::UnitX()),
                                                 picture(0.6f, 1, 8, Vec3f::UnitY())};
    const std::vector<double> weights = {0.75, 0.25};
    const RenderedImage blend = blendPictures(pictures, weights);
    CHECK(*blend.rgb.at(1, 0) == Approx(0.3));
    CHECK(*blend.opacity.at(1, 0) == Approx(0.625));
    CHECK(*blend.depth.at(1, 0) == Approx((0.375 * 4 + 0.25 * 8) / 0.625));
    CHECK(blend.normal.at(0, 0)[0] == Approx(0.375 / std::hypot(0.375, 0.25)));
    CHECK(blend.normal.at(0, 0)[1] == Approx(0.25 / std::hypot(0.375, 0.25)));
    CHECK(blend.counters.rays == 4);
}

TEST_CASE("one picture alone stays what it is", "[vdb]") {
    const std::vector<RenderedImage> pictures = {picture(0.2f, 0.5f, 4, Vec3f::UnitZ())};
    const RenderedImage blend = blendPictures(pictures, std::vector<double>{1.0});
    CHECK(blend.rgb.pixels == pictures[0].rgb.pixels);
    CHECK(blend.opacity.pixels == pictures[0].opacity.pixels);
    CHECK(blend.depth.pixels == pictures[0].depth.pixels);
    CHECK(blend.normal.pixels == pictures[0].normal.pixels);
}

TEST_CASE("where nothing counts there is no depth, and none is pulled towards the eye", "[vdb]") {
    const std::vector<double> half = {0.5, 0.5};
    const RenderedImage nothing = blendPictures(
        std::vector<RenderedImage>{picture(1, 0, 0, Vec3f::Zero()), picture(1, 0, 0, Vec3f::Zero())}, half);
    CHECK(*nothing.depth.at(0, 0) == 0);
    CHECK(nothing.normal.at(0, 0)[0] == 0);
    // Opacity, but of samples that were not kept: no depth.
    const RenderedImage one = blendPictures(
        std::vector<RenderedImage>{picture(1, 0.004f, 0, Vec3f::Zero()), picture(1, 0.5f, 6, Vec3f::UnitX())}, half);
    CHECK(*one.depth.at(0, 0) == Approx(6));
}

TEST_CASE("pictures that do not fit together are refused", "[vdb]") {
    CHECK_THROWS_AS(blendPictures({}, {}), UsageError);
    const std::vector<RenderedImage> one = {picture(1, 1, 1, Vec3f::UnitX())};
    CHECK_THROWS_AS(blendPictures(one, std::vector<double>{0.5, 0.5}), UsageError);
    std::vector<RenderedImage> two = {one[0], one[0]};
    two[1].rgb = Image(3, 1, 3);
    CHECK_THROWS_AS(blendPictures(two, std::vector<double>{0.5, 0.5}), UsageError);
}
