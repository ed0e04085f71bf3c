// SPDX-License-Identifier: Apache-2.0
#include "cli/pictures_for_eyes.h"

#include <utility>
#include <vector>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

Image picture(int width, int channels, std::vector<float> pixels) {
    Image image(width, static_cast<int>(pixels.size()) / width / channels, channels);
    image.pixels = std::move(pixels);
    return image;
}

}  // namespace

TEST_CASE("depth goes from white to dark by its logarithm, and nothing is black") {
    const Image grey = depthForEyes(picture(4, 1, {2, 20, 200, 0}));
    CHECK(grey.pixels[0] == 1.0f);
    CHECK(grey.pixels[1] == Approx(0.55));
    CHECK(grey.pixels[2] == Approx(0.1));
    CHECK(grey.pixels[3] == 0.0f);
    CHECK(depthForEyes(picture(2, 1, {3, 3})).pixels == std::vector<float>{1, 1});
    CHECK(depthForEyes(picture(2, 1, {0, 0})).pixels == std::vector<float>{0, 0});
}

TEST_CASE("pictures stand side by side, grey ones as well") {
    const std::vector<Image> pictures = {picture(1, 3, {1, 2, 3, 4, 5, 6}), picture(2, 1, {7, 8, 9, 10})};
    const Image row = sideBySide(pictures);
    CHECK(row.width == 3);
    CHECK(row.height == 2);
    CHECK(row.pixels == std::vector<float>{1, 2, 3, 7, 7, 7, 8, 8, 8, 4, 5, 6, 9, 9, 9, 10, 10, 10});
    CHECK_THROWS_AS(sideBySide(std::vector<Image>{picture(1, 1, {1}), picture(1, 1, {1, 2})}), UsageError);
    CHECK_THROWS_AS(sideBySide(std::vector<Image>{picture(1, 4, {1, 2, 3, 4})}), UsageError);
}
