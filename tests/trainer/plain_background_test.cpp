// SPDX-License-Identifier: Apache-2.0
#include "trainer/plain_background.h"

#include <cmath>
#include <cstdint>

#include "core/random.h"
#include "tests/support/catch.h"

namespace nerfvdb {
namespace {

constexpr int kWidth = 40, kHeight = 30;

/// Photographs of one colour, with something else in the middle of each.
Dataset objectBefore(const Photo::Pixel& colour, std::size_t n_views = 10) {
    Dataset dataset;
    dataset.views.resize(n_views);
    for (View& view : dataset.views) {
        view.photo.width = kWidth, view.photo.height = kHeight;
        view.photo.pixels.assign(kWidth * kHeight, colour);
        for (int y = 8; y < 20; ++y)
            for (int x = 10; x < 30; ++x) view.photo.pixels[y * kWidth + x] = {90, 20, 10, 255};
    }
    return dataset;
}

void paint(Photo& photo, int x0, int y0, int x1, int y1, const Photo::Pixel& colour) {
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x) photo.pixels[y * kWidth + x] = colour;
}

}  // namespace

TEST_CASE("the colour along the borders is the plain background, up to what compression does to it") {
    Dataset dataset = objectBefore({255, 240, 128, 255});
    REQUIRE(plainBackground(dataset));
    CHECK((255 * *plainBackground(dataset) - Vec3f(255, 240, 128)).norm() < 1e-3f);

    std::uint64_t n = 0;
    for (View& view : dataset.views)
        for (Photo::Pixel& pixel : view.photo.pixels)
            pixel[1] = static_cast<std::uint8_t>(pixel[1] + static_cast<int>(mixBits(++n) % 9) - 4);
    REQUIRE(plainBackground(dataset));
    CHECK(std::abs(255 * plainBackground(dataset)->y() - 240) <= 1);
}

TEST_CASE("an object may reach over the edge of a picture, and one picture in ten be a close-up") {
    Dataset dataset = objectBefore({0, 0, 0, 255});
    for (View& view : dataset.views) paint(view.photo, 5, 10, 15, kHeight, {200, 200, 200, 255});  // 10 of 136 border pixels
    dataset.views[3] = objectBefore({200, 100, 0, 255}, 1).views.front();
    CHECK(plainBackground(dataset));
    dataset.views[4] = dataset.views[3];
    CHECK_FALSE(plainBackground(dataset));
}

TEST_CASE("a lit wall, a floor under a plain wall, and photographs before different colours are none") {
    Dataset wall = objectBefore({0, 0, 0, 255}), floor = objectBefore({255, 255, 255, 255}), colours = wall;
    for (View& view : wall.views)
        for (int y = 0; y < kHeight; ++y)
            paint(view.photo, 0, y, kWidth, y + 1, {static_cast<std::uint8_t>(200 + y), 210, 220, 255});
    CHECK_FALSE(plainBackground(wall));
    for (View& view : floor.views) paint(view.photo, 0, kHeight - 4, kWidth, kHeight, {120, 110, 100, 255});
    CHECK_FALSE(plainBackground(floor));
    for (std::size_t v = 0; v < 5; ++v) colours.views[v] = objectBefore({255, 255, 255, 255}, 1).views.front();
    CHECK_FALSE(plainBackground(colours));
}

TEST_CASE("a black border around photographs is no background") {
    Dataset dataset = objectBefore({0, 0, 0, 255});
    for (View& view : dataset.views)
        for (int y = 2; y < kHeight - 2; ++y) paint(view.photo, 3, y, kWidth - 3, y + 1, {120, 110, 100, 255});
    CHECK_FALSE(plainBackground(dataset));
}

TEST_CASE("the black around a fisheye's round picture is no background") {
    Dataset dataset = objectBefore({0, 0, 0, 255});
    CHECK(plainBackground(dataset));
    for (View& view : dataset.views) view.camera.distortion.model = LensModel::fisheye;
    CHECK_FALSE(plainBackground(dataset));
}

TEST_CASE("pixels that a mask leaves out do not count, and where none counts nothing is known") {
    Dataset dataset = objectBefore({255, 255, 255, 255});
    for (View& view : dataset.views) {
        paint(view.photo, 0, kHeight - 4, kWidth, kHeight, {120, 110, 100, 255});
        view.mask = PixelMask(kWidth, kHeight);
        for (int y = 0; y < kHeight - 4; ++y)
            for (int x = 0; x < kWidth; ++x) view.mask.keep(x, y);
    }
    CHECK(plainBackground(dataset));
    for (View& view : dataset.views) view.mask = PixelMask(kWidth, kHeight);
    CHECK_FALSE(plainBackground(dataset));
    CHECK_FALSE(plainBackground(Dataset()));
}

}  // namespace nerfvdb
