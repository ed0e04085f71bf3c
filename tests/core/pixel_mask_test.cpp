// SPDX-License-Identifier: Apache-2.0
#include "core/pixel_mask.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("a mask keeps each pixel by itself, in sizes that fill no tile too") {
    CHECK(PixelMask().empty());
    CHECK(PixelMask().counts(1000, 3));
    PixelMask mask(19, 10);
    CHECK_FALSE(mask.empty());
    CHECK(mask.count() == 0);
    const auto kept = [](int x, int y) { return (x * 7 + y * 3) % 5 == 0; };
    std::size_t n = 0;
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 19; ++x)
            if (kept(x, y)) mask.keep(x, y), ++n;
    int wrong = 0;
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 19; ++x) {
            wrong += mask.counts(x, y) != kept(x, y);
            wrong += (mask.tile(x / 8, y / 8) >> (8 * (y % 8) + x % 8) & 1) != kept(x, y);
        }
    CHECK(wrong == 0);
    CHECK(mask.count() == n);
    CHECK(mask.tiles().size() == 6);
}
