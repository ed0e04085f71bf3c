// SPDX-License-Identifier: Apache-2.0
#include "trainer/photo_sharpness.h"

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Squares of random greys, `size` pixels wide, mixed linearly between their middles: nothing in it is finer.
View picture(int size, int width, int height, std::uint64_t seed) {
    const auto grey = [&](int i, int j) { return static_cast<double>(randomBits(seed, static_cast<std::uint64_t>(i), j) % 256); };
    View view;
    view.photo.width = width, view.photo.height = height;
    view.photo.pixels.resize(static_cast<std::size_t>(width) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int i = x / size, j = y / size;
            const double u = static_cast<double>(x % size) / size, v = static_cast<double>(y % size) / size;
            const double value = (1 - v) * ((1 - u) * grey(i, j) + u * grey(i + 1, j)) +
                                 v * ((1 - u) * grey(i, j + 1) + u * grey(i + 1, j + 1));
            const auto byte = static_cast<std::uint8_t>(value);
            view.photo.pixels[static_cast<std::size_t>(y) * width + x] = {byte, byte, byte, 255};
        }
    return view;
}

Dataset pictures(std::initializer_list<int> sizes) {
    Dataset dataset;
    for (const int size : sizes) dataset.views.push_back(picture(size, 200, 150, dataset.views.size()));
    return dataset;
}

}  // namespace

TEST_CASE("what photographs resolve is told from how fast they change") {
    CHECK(resolvedPixels(pictures({1})) == 1);
    CHECK(resolvedPixels(pictures({2})) == 2);
    CHECK(resolvedPixels(pictures({4})) == 4);
    CHECK(resolvedPixels(pictures({8})) == 8);
    CHECK(resolvedPixels(pictures({64})) == 8);  // no more is ever said
    CHECK(resolvedPixels(pictures({1, 1, 16})) == 1);
    CHECK(resolvedPixels(pictures({16, 1, 16})) == 8);
}

TEST_CASE("photographs that say nothing of their sharpness are taken for sharp") {
    CHECK(resolvedPixels(Dataset{}) == 1);
    Dataset plain;
    plain.views.push_back(picture(4, 10, 10, 1));  // too small
    View grey = picture(4, 100, 100, 1);
    for (Photo::Pixel& pixel : grey.photo.pixels) pixel = {90, 90, 90, 255};
    plain.views.push_back(grey);
    CHECK(resolvedPixels(plain) == 1);
    plain.views.push_back(picture(16, 100, 100, 1));
    CHECK(resolvedPixels(plain) == 8);
}
