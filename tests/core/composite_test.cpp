// SPDX-License-Identifier: Apache-2.0
#include "core/composite.h"

#include <cmath>
#include <vector>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// A ray with random optical depths and loss slopes; tau spans 1e-6 to `largest` evenly in its logarithm.
struct RandomRay {
    std::vector<double> tau, slope;
    double dl_dtransmittance;
    RandomRay(int n, double largest, std::uint64_t seed) {
        const auto unit = [&](int stream, int i) {
            return static_cast<double>(unitFloat(static_cast<std::uint32_t>(randomBits(seed, stream, i))));
        };
        for (int i = 0; i < n; ++i) {
            tau.push_back(1e-6 * std::pow(largest / 1e-6, unit(0, i)));
            slope.push_back(2 * unit(1, i) - 1);
        }
        dl_dtransmittance = 2 * unit(2, 0) - 1;
    }

    /// The loss sum_i slope_i w_i + dl_dT T_end, from the definition, in double.
    double loss(const std::vector<double>& depths) const {
        double sum = 0, before = 0;
        for (std::size_t i = 0; i < depths.size(); ++i) {
            sum += slope[i] * std::exp(-before) * -std::expm1(-depths[i]);
            before += depths[i];
        }
        return sum + dl_dtransmittance * std::exp(-before);
    }
};

struct Forward {
    std::vector<float> weight, behind;
    CompositeRay ray;
    explicit Forward(const std::vector<double>& tau) {
        for (const double t : tau) {
            weight.push_back(ray.add(static_cast<float>(-std::expm1(-t)), static_cast<float>(std::exp(-t))));
            behind.push_back(static_cast<float>(ray.transmittance));
        }
    }
};

}  // namespace

TEST_CASE("weights and transmittance sum to one, from fog to walls") {
    for (const double largest : {1e-4, 1.0, 1e3, 1e8}) {
        const RandomRay random(200, largest, 4);
        const Forward forward(random.tau);
        double sum = forward.ray.transmittance;
        for (const float w : forward.weight) sum += w;
        // Each weight and each decay is rounded to 6e-8 of itself, and they sum to 1: 200 samples or 2.
        CHECK(sum == Approx(1).margin(3e-7));
    }
}

TEST_CASE("a hundred thousand samples, each too thin for its decay to differ from 1, stop the light that they weigh") {
    constexpr int kSamples = 100000;
    for (const double tau : {1e-12, 1e-9, 1e-8, 2.9e-8, 3.1e-8, 1e-7, 1e-5}) {
        const Forward forward(std::vector<double>(kSamples, tau));
        // Each step rounds the light that is left, about 1, to 1e-16.
        CHECK(1 - forward.ray.transmittance == Approx(-std::expm1(-kSamples * tau)).epsilon(1e-6).margin(1e-11));
    }
}

TEST_CASE("the backward sum is the derivative, judged against the magnitudes of its terms") {
    for (const double largest : {1e-2, 1.0, 50.0, 1e6}) {
        const RandomRay random(64, largest, 5);
        const Forward forward(random.tau);
        CompositeRayBackward backward(static_cast<float>(forward.ray.transmittance), static_cast<float>(random.dl_dtransmittance));
        for (int i = 63; i >= 0; --i) {
            const float found = backward.add(forward.weight[i], forward.behind[i], static_cast<float>(random.slope[i]));

            // The definition in double: T_{i+1} a_i - sum_{j>i} w_j a_j - T_end dl_dT.
            double before = 0, terms = 0, expected = 0;
            for (int j = 0; j <= i; ++j) before += random.tau[j];
            expected = std::exp(-before) * random.slope[i];
            terms = std::abs(expected);
            for (int j = i + 1; j < 64; ++j) {
                const double w = std::exp(-before) * -std::expm1(-random.tau[j]);
                expected -= w * random.slope[j];
                terms += std::abs(w * random.slope[j]);
                before += random.tau[j];
            }
            expected -= std::exp(-before) * random.dl_dtransmittance;
            terms += std::abs(std::exp(-before) * random.dl_dtransmittance);
            // Up to 64 single-precision products in a row: 64 * 6e-8 of the terms, and denormals below 1e-37.
            CHECK(std::abs(found - expected) <= 64 * 6e-8 * terms + 1e-37);
        }
    }
}

TEST_CASE("the definition's derivative agrees with central differences") {
    // Ties the formula above to the loss itself: double, h = 1e-6 of tau ~ 1, so 1e-9 of rounding and of curvature.
    const RandomRay random(16, 2.0, 6);
    for (std::size_t i = 0; i < random.tau.size(); ++i) {
        std::vector<double> up = random.tau, down = random.tau;
        up[i] += 1e-6;
        down[i] -= 1e-6;
        const double difference = (random.loss(up) - random.loss(down)) / 2e-6;
        const Forward forward(random.tau);
        CompositeRayBackward backward(static_cast<float>(forward.ray.transmittance), static_cast<float>(random.dl_dtransmittance));
        float found = 0;
        for (std::size_t j = random.tau.size(); j-- > i;)
            found = backward.add(forward.weight[j], forward.behind[j], static_cast<float>(random.slope[j]));
        CHECK(found == Approx(difference).margin(1e-5));  // 16 roundings of 6e-8 of terms up to 16
    }
}
