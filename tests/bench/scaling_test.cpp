// SPDX-License-Identifier: Apache-2.0
#include "bench/scaling.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {
using Times = std::vector<std::pair<int, double>>;
}

TEST_CASE("Amdahl's serial share from times worked out by hand") {
    CHECK(serialShare(Times{{1, 8.0}, {2, 4.0}, {4, 2.0}}) == Approx(0).margin(1e-12));
    CHECK(serialShare(Times{{1, 8.0}, {2, 8.0}, {4, 8.0}}) == Approx(1));
    // T(2) / T(1) = s + (1 - s) / 2 = 0.6 -> s = 0.2
    CHECK(serialShare(Times{{1, 10.0}, {2, 6.0}}) == Approx(0.2));
    // A law that holds exactly is found from any number of threads.
    Times times;
    for (const int n : {1, 2, 3, 7, 16}) times.emplace_back(n, 5 * (0.05 + 0.95 / n));
    CHECK(serialShare(times) == Approx(0.05));
    // Better than perfect (noise, caches) counts as perfect.
    CHECK(serialShare(Times{{1, 10.0}, {2, 4.9}}) == 0);
    CHECK(serialShare(Times{{1, 10.0}}) == 0);
    CHECK_THROWS_AS(serialShare(Times{{2, 10.0}}), UsageError);
}

TEST_CASE("speed-up by Amdahl's law") {
    CHECK(amdahlSpeedup(0, 16) == Approx(16));
    CHECK(amdahlSpeedup(1, 16) == Approx(1));
    CHECK(amdahlSpeedup(0.2, 2) == Approx(1 / 0.6));
    CHECK(amdahlSpeedup(0.05, 1) == Approx(1));
}
