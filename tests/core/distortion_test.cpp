// SPDX-License-Identifier: Apache-2.0
#include "core/distortion.h"

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
    double spread() const {
        double sum = 0;
        for (std::size_t i = 0; i < weight.size(); ++i)
            for (std::size_t j = 0; j < weight.size(); ++j)
                sum += weight[i] * weight[j] * std::abs(distance[i] - distance[j]);
        return sum;
    }
};

DistortionRay forwardOf(const RandomRay& ray) {
    DistortionRay result;
    for (std::size_t i = 0; i < ray.weight.size(); ++i)
        result.add(static_cast<float>(ray.weight[i]), static_cast<float>(ray.distance[i]));
    return result;
}

}  // namespace

TEST_CASE("distortion is the double sum over pairs of samples") {
    for (const int n : {1, 2, 7, 300}) {
        const RandomRay ray(n, 5);
        // n differences of sums of at most 1, each rounded to 6e-8, times weights that sum to at most 1.
        CHECK(forwardOf(ray).spread == Approx(ray.spread()).margin(4e-7));
    }
}

TEST_CASE("distortion of light from one place is nothing, of two places their distance") {
    DistortionRay one;
    one.add(1, 0.3f);
    CHECK(one.spread == 0);
    DistortionRay two;
    two.add(0.5f, 0.25f);
    two.add(0.5f, 0.75f);
    CHECK(two.spread == Approx(2 * 0.5 * 0.5 * 0.5));
}

TEST_CASE("distortion's gradient agrees with central differences") {
    const RandomRay ray(60, 8);
    DistortionRayBackward backward(forwardOf(ray));
    for (std::size_t i = ray.weight.size(); i-- > 0;) {
        const float slope = backward.add(static_cast<float>(ray.weight[i]), static_cast<float>(ray.distance[i]));
        RandomRay up = ray, down = ray;
        up.weight[i] += 1e-3, down.weight[i] -= 1e-3;
        // The loss is quadratic: the difference quotient is exact, and what is left are roundings of sums of 1.
        CHECK(slope == Approx((up.spread() - down.spread()) / 2e-3).margin(1e-6));
    }
}
