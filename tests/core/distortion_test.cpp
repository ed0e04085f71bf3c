// SPDX-License-Identifier: Apache-2.0
#include "core/distortion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Samples along a ray of length 1, their weights summing to at most 1.
struct RandomRay {
    std::vector<double> weight, distance;
    RandomRay(int n, std::uint64_t seed) {
        for (int i = 0; i < n; ++i) {
            const auto unit = static_cast<double>(unitFloat(static_cast<std::uint32_t>(randomBits(seed, 0, i))));
            weight.push_back(unit / n);
            distance.push_back((i + unit) / n);
        }
    }

    /// The double sum, in double.
    double spread(double reach) const {
        double sum = 0;
        for (std::size_t i = 0; i < weight.size(); ++i)
            for (std::size_t j = 0; j < weight.size(); ++j)
                sum += weight[i] * weight[j] * reach * -std::expm1(-std::abs(distance[i] - distance[j]) / reach);
        return sum;
    }

    /// dD_dw of each sample, by a scan each way.
    std::vector<double> slopes(double reach) const {
        std::vector<double> result(weight.size());
        DistortionScan there, back;
        const auto add = [&](DistortionScan& scan, std::size_t i, std::size_t before) {
            const double gap = std::abs(distance[i] - distance[before]);
            result[i] += 2 * reach *
                         static_cast<double>(scan.add(static_cast<float>(weight[i]), static_cast<float>(std::exp(-gap / reach))));
        };
        for (std::size_t i = 0; i < weight.size(); ++i) add(there, i, i > 0 ? i - 1 : i);
        for (std::size_t i = weight.size(); i-- > 0;) add(back, i, std::min(i + 1, weight.size() - 1));
        return result;
    }
};

constexpr double kReaches[] = {0.02, 0.2, 8};
// Sums of weights that are at most 1, each of n terms rounded to 6e-8, times the reach and 2; they err at random.
double roundings(int n, double reach) { return 1e-7 * (1 + 2 * reach * std::sqrt(n)); }

}  // namespace

TEST_CASE("distortion is the double sum over pairs of samples") {
    for (const int n : {1, 2, 7, 300})
        for (const double reach : kReaches) {
            CAPTURE(n, reach);
            const RandomRay ray(n, 5);
            double sum = 0;
            const std::vector<double> slopes = ray.slopes(reach);
            for (std::size_t i = 0; i < slopes.size(); ++i) sum += 0.5 * ray.weight[i] * slopes[i];
            CHECK(sum == Approx(ray.spread(reach)).margin(roundings(n, reach)));
        }
}

TEST_CASE("distortion's gradient agrees with central differences") {
    for (const double reach : kReaches) {
        CAPTURE(reach);
        const RandomRay ray(60, 8);
        const std::vector<double> slopes = ray.slopes(reach);
        for (std::size_t i = 0; i < ray.weight.size(); ++i) {
            RandomRay up = ray, down = ray;
            up.weight[i] += 1e-3, down.weight[i] -= 1e-3;
            // The loss is quadratic: the difference quotient is exact, and what is left are roundings.
            CHECK(slopes[i] == Approx((up.spread(reach) - down.spread(reach)) / 2e-3).margin(roundings(60, reach)));
        }
    }
}

TEST_CASE("light from one place has no distortion, that from two their distance up to the reach") {
    DistortionScan scan;
    CHECK(scan.add(1, 0.3f) == 0);
    CHECK(scan.add(1, 1) == 0);
    const auto apart = [](double distance, double reach) {
        RandomRay ray(0, 0);
        ray.weight = {0.5, 0.5}, ray.distance = {0.25, 0.25 + distance};
        return ray.slopes(reach)[0] / (2 * 0.5);
    };
    CHECK(apart(0.5, 8) == Approx(0.5).epsilon(0.04));         // d(s) = s (1 - s / (2 reach) + ...)
    CHECK(apart(0.001, 0.2) == Approx(0.001).epsilon(0.003));
    CHECK(apart(100, 0.2) == Approx(0.2));
}
