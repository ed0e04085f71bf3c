// SPDX-License-Identifier: Apache-2.0
#include "core/positive_polynomial.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

double symmetric(std::uint64_t i, std::uint64_t j) {
    return 2.0 * static_cast<double>(unitFloat(static_cast<std::uint32_t>(randomBits(11, i, j)))) - 1;
}

}  // namespace

TEST_CASE("a polynomial is positive where its least value on a dense grid is", "[core]") {
    int positive = 0, negative = 0;
    for (std::uint64_t i = 0; i < 2000; ++i) {
        std::array<double, 7> c{1};
        const double end = 0.2 + 3 * std::abs(symmetric(i, 9));
        for (std::size_t k = 1; k < c.size(); ++k) c[k] = 3 * symmetric(i, k) / std::pow(end, static_cast<double>(k));
        double least = 1;
        for (int step = 0; step <= 2000; ++step) {
            double value = 0;
            for (std::size_t k = c.size(); k-- > 0;) value = value * (end * step / 2000) + c[k];
            least = std::min(least, value);
        }
        if (std::abs(least) < 1e-4) continue;  // the grid may step over a dip
        CAPTURE(i, least);
        CHECK(isPositiveUpTo(c, end) == (least > 0));
        (least > 0 ? positive : negative)++;
    }
    CHECK(positive > 200);
    CHECK(negative > 200);
}

TEST_CASE("touching zero is not positive, just missing it is", "[core]") {
    // (u - 1)^2 + e
    CHECK_FALSE(isPositiveUpTo(std::array{1.0, -2.0, 1.0}, 3));
    CHECK(isPositiveUpTo(std::array{1.0 + 1e-9, -2.0, 1.0}, 3));
    CHECK(isPositiveUpTo(std::array{1.0, -2.0, 1.0}, 0.999));
    CHECK_FALSE(isPositiveUpTo(std::array{1.0, -2.0, 1.0}, 1));
    CHECK_FALSE(isPositiveUpTo(std::array{0.0, 1.0}, 1));
    CHECK(isPositiveUpTo(std::array{1.0, 0.0, 0.0}, 1e300));
    CHECK_FALSE(isPositiveUpTo(std::array{1.0, std::numeric_limits<double>::quiet_NaN()}, 1));
    CHECK_FALSE(isPositiveUpTo(std::array{1.0, 1.0}, std::numeric_limits<double>::quiet_NaN()));
    CHECK_FALSE(isPositiveUpTo(std::array{1.0, 1.0, -1.0}, 1e200));
}
