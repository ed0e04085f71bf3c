// SPDX-License-Identifier: Apache-2.0
#include "bench/pareto.h"

#include <algorithm>
#include <limits>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// The definition, without a clever order.
std::vector<std::size_t> bruteForce(const std::vector<CostQuality>& points) {
    std::vector<std::size_t> front;
    for (std::size_t i = 0; i < points.size(); ++i) {
        bool is_beaten = false;
        for (std::size_t j = 0; j < points.size(); ++j) {
            const bool no_worse = points[j].cost <= points[i].cost && points[j].quality >= points[i].quality;
            const bool equal = points[j].cost == points[i].cost && points[j].quality == points[i].quality;
            is_beaten = is_beaten || (no_worse && (!equal || j < i));
        }
        if (!is_beaten) front.push_back(i);
    }
    std::sort(front.begin(), front.end(), [&](auto a, auto b) { return points[a].cost < points[b].cost; });
    return front;
}

}  // namespace

TEST_CASE("the Pareto front is what brute force says, with ties and duplicates") {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        std::vector<CostQuality> points;
        for (std::uint64_t i = 0; i < 40; ++i)  // few different values, so that ties are common
            points.push_back({static_cast<double>(randomBits(seed, 0, i) % 12),
                              static_cast<double>(randomBits(seed, 1, i) % 12)});
        CAPTURE(seed);
        CHECK(paretoFront(points) == bruteForce(points));
    }
}

TEST_CASE("a Pareto front of nothing, of one, and without what is not finite") {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    CHECK(paretoFront({}).empty());
    const std::vector<CostQuality> one = {{3, 4}};
    CHECK(paretoFront(one) == std::vector<std::size_t>{0});
    const std::vector<CostQuality> odd = {
        {kNan, 99}, {1, kNan}, {2, 5}, {1, std::numeric_limits<double>::infinity()}};
    CHECK(paretoFront(odd) == std::vector<std::size_t>{2});
}
