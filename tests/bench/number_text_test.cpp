// SPDX-License-Identifier: Apache-2.0
#include "bench/number_text.h"

#include <cmath>
#include <limits>
#include <string>

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("numbers as people write them") {
    CHECK(numberText(0) == "0");
    CHECK(numberText(0.03124999) == "0.03125");
    CHECK(numberText(31.2468) == "31.25");
    CHECK(numberText(152300.4) == "152300");
    CHECK(numberText(1e-7) == "1e-07");
    CHECK(numberText(-2.5) == "-2.5");
    CHECK(numberText(std::numeric_limits<double>::quiet_NaN()) == "nan");
    CHECK(tickText(0.05) == "0.05");
    CHECK(tickText(5000) == "5000");
    CHECK(tickText(150000) == "150k");
    CHECK(tickText(1500000) == "1.5M");
    CHECK(tickText(2e9) == "2G");
}

TEST_CASE("an exact text reads back as the same number") {
    for (const double value : {0.1, 1.0 / 3, 1e300, -2.5e-308, 123456789.123456789, 0.0})
        CHECK(std::stod(exactText(value)) == value);
}
