// SPDX-License-Identifier: Apache-2.0
#include "core/opacity_entropy.h"

#include <cmath>

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("the entropy of opacity is that of a coin, and goes on straight where it is decided") {
    const auto exact = [](double t) { return -t * std::log(t) - (1 - t) * std::log(1 - t); };
    for (const float t : {0.001f, 0.01f, 0.2f, 0.5f, 0.7f, 0.998f}) {
        CAPTURE(t);
        CHECK(opacityEntropy(t) == Approx(exact(t)).epsilon(1e-5));  // 1 - t has five digits left at 0.998
    }
    CHECK(opacityEntropySlope(0) == opacityEntropySlope(kDecided));
    CHECK(opacityEntropySlope(1) == opacityEntropySlope(1 - kDecided));
    CHECK(opacityEntropy(0) > 0);
    CHECK(opacityEntropy(0) < opacityEntropy(kDecided));
    CHECK(opacityEntropy(1) > 0);
    CHECK(opacityEntropy(1) == Approx(opacityEntropy(0)).epsilon(1e-3));
}

TEST_CASE("the slope of the entropy agrees with central differences, and leads away from a half") {
    for (float t = 0; t <= 1; t += 1.0f / 64) {
        CAPTURE(t);
        const float up = std::fmin(t + 1e-3f, 1.0f), down = std::fmax(t - 1e-3f, 0.0f);
        // H''' h^2 / 6 is 7e-4 at t = 1/64; a rounding of H, at most 6e-8 / 2, is 3e-5 of a slope.
        CHECK(opacityEntropySlope(t) == Approx((opacityEntropy(up) - opacityEntropy(down)) / (up - down)).margin(1e-3));
    }
    CHECK(opacityEntropySlope(0.4f) > 0);  // less of it falls on to 0
    CHECK(opacityEntropySlope(0.5f) == 0);
    CHECK(opacityEntropySlope(0.6f) < 0);
}
