// SPDX-License-Identifier: Apache-2.0
#include "core/mlp.h"

#include <algorithm>
#include <cmath>

#include "core/simd/kernels.h"
#include "tests/support/catch.h"
#include "tests/support/central_difference.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;
using test::randomIn;

namespace {

const MlpShape kShape{{5, 12, 9, 3}};  // nothing is a multiple of a vector
constexpr int kBatch = 21;

/// The network written down plainly, in double. Loss: sum of slope * output.
struct SlowMlp {
    std::vector<double> parameters, input;  // input [channel][sample]
    std::vector<double> slope;              // [out][sample]
    mutable double smallest_hidden = 1e30;  // how near any ReLU is to its kink

    std::vector<double> outputs() const {
        std::vector<double> in = input, out;
        std::size_t offset = 0;
        for (std::size_t l = 0; l < kShape.layerCount(); ++l) {
            const int n_in = kShape.widths[l], n_out = kShape.widths[l + 1];
            out.assign(static_cast<std::size_t>(n_out) * kBatch, 0.0);
            for (int o = 0; o < n_out; ++o)
                for (int b = 0; b < kBatch; ++b) {
                    double sum = parameters[offset + n_in * n_out + o];
                    for (int i = 0; i < n_in; ++i)
                        sum += parameters[offset + o * n_in + i] * in[i * kBatch + b];
                    const bool is_hidden = l + 1 < kShape.layerCount();
                    if (is_hidden) smallest_hidden = std::min(smallest_hidden, std::abs(sum));
                    out[o * kBatch + b] = is_hidden ? std::max(sum, 0.0) : sum;
                }
            offset += static_cast<std::size_t>(n_in + 1) * n_out;
            in = out;
        }
        return out;
    }
    double loss() const {
        const std::vector<double> out = outputs();
        double sum = 0;
        for (std::size_t i = 0; i < out.size(); ++i) sum += slope[i] * out[i];
        return sum;
    }
    /// Central difference. The loss is piecewise multilinear in the parameters, so that away from kinks only
    /// rounding is left: 1e-16 * 100 / 1e-7.
    double derivative(double& variable) const {
        constexpr double kStep = 1e-7;
        return test::centralDifference([&] { return loss(); }, variable, kStep);
    }
};

/// The same network twice: fast, forward and backward done, and slow.
struct Pair {
    std::vector<float> parameters;
    MlpActivations activations, gradients;
    std::vector<float> dl_dparameters;
    SlowMlp slow;

    explicit Pair(float gradient_before = 0) {
        parameters = initialMlpParameters(kShape, 3, 0.5f);
        for (std::size_t i = 0; i < parameters.size(); ++i)
            parameters[i] += randomIn(-0.3f, 0.3f, 90, i);  // biases too
        activations.resize(kShape, kBatch);
        gradients.resize(kShape, kBatch);
        dl_dparameters.assign(parameters.size(), gradient_before);
        slow.parameters.assign(parameters.begin(), parameters.end());
        for (int i = 0; i < kShape.widths.front(); ++i)
            for (int b = 0; b < kBatch; ++b) {
                activations.layer(0)[i * activations.stride + b] = randomIn(-1, 1, 91, i * kBatch + b);
                slow.input.push_back(activations.layer(0)[i * activations.stride + b]);
            }
        const std::size_t last = kShape.layerCount();
        for (int o = 0; o < kShape.widths.back(); ++o)
            for (int b = 0; b < kBatch; ++b) {
                gradients.layer(last)[o * gradients.stride + b] = randomIn(-1, 1, 92, o * kBatch + b);
                slow.slope.push_back(gradients.layer(last)[o * gradients.stride + b]);
            }
        mlpForward(kShape, parameters, kBatch, activations);
        mlpBackward(kShape, parameters, kBatch, activations, gradients, dl_dparameters);
    }
};

// Sums of at most 21 samples times 12 inputs in single precision: 252 * 6e-8 of magnitudes of order 1.
constexpr double kTolerance = 2e-5;

}  // namespace

TEST_CASE("a network's outputs agree with a plain one in double") {
    Pair pair;
    const std::vector<double> expected = pair.slow.outputs();
    const float* const found = pair.activations.layer(kShape.layerCount());
    for (int o = 0; o < 3; ++o)
        for (int b = 0; b < kBatch; ++b)
            CHECK(found[o * pair.activations.stride + b] ==
                  Approx(expected[o * kBatch + b]).margin(kTolerance));
}

TEST_CASE("a network's gradients agree with central differences, section by section") {
    Pair pair;
    pair.slow.outputs();
    REQUIRE(pair.slow.smallest_hidden > 1e-5);  // no kink within the difference's step
    std::size_t offset = 0;
    for (std::size_t l = 0; l < kShape.layerCount(); ++l) {
        const std::size_t n_weights = static_cast<std::size_t>(kShape.widths[l]) * kShape.widths[l + 1];
        const std::size_t n_bias = static_cast<std::size_t>(kShape.widths[l + 1]);
        for (const auto& [section, n] : {std::pair{"weights", n_weights}, {"bias", n_bias}}) {
            CAPTURE(l, section);
            int wrong = 0;
            double largest = 0;
            for (std::size_t i = offset; i < offset + n; ++i) {
                const double expected = pair.slow.derivative(pair.slow.parameters[i]);
                wrong += !(std::abs(pair.dl_dparameters[i] - expected) <= kTolerance);
                largest = std::max(largest, std::abs(expected));
            }
            CHECK(wrong == 0);
            CHECK(largest > 0.1);  // or nothing was tested
            offset += n;
        }
    }
    REQUIRE(offset == kShape.parameterCount());

    int wrong = 0;
    for (int i = 0; i < kShape.widths.front(); ++i)
        for (int b = 0; b < kBatch; ++b) {
            const double expected = pair.slow.derivative(pair.slow.input[i * kBatch + b]);
            wrong +=
                !(std::abs(pair.gradients.layer(0)[i * pair.gradients.stride + b] - expected) <= kTolerance);
        }
    CHECK(wrong == 0);
}

TEST_CASE("gradients of parameters are added to what is there") {
    const Pair fresh, added(2.0f);
    for (std::size_t i = 0; i < fresh.dl_dparameters.size(); ++i)
        CHECK(added.dl_dparameters[i] == Approx(2.0f + fresh.dl_dparameters[i]).margin(1e-6));
}

TEST_CASE("a network begins as He et al. say: zero biases, uniform weights of variance 2 / inputs") {
    const MlpShape shape{{50, 200, 3}};
    const std::vector<float> parameters = initialMlpParameters(shape, 1, 0.1f);
    REQUIRE(parameters.size() == 51 * 200 + 201 * 3);
    CHECK(std::all_of(&parameters[50 * 200], &parameters[51 * 200], [](float bias) { return bias == 0; }));
    double squares = 0, largest = 0, largest_last = 0;
    for (int i = 0; i < 50 * 200; ++i) {
        squares += static_cast<double>(parameters[i]) * parameters[i];
        largest = std::max(largest, std::abs(static_cast<double>(parameters[i])));
    }
    for (int i = 51 * 200; i < 51 * 200 + 600; ++i)
        largest_last = std::max(largest_last, std::abs(static_cast<double>(parameters[i])));
    // The variance of 10^4 uniform numbers is known to 0.9 % (one standard deviation); four are allowed.
    CHECK(squares / 10000 == Approx(2.0 / 50).epsilon(0.036));
    CHECK(largest <= std::sqrt(6.0 / 50));
    CHECK(largest_last <= 0.1 * std::sqrt(6.0 / 200));
    CHECK(largest_last > 0.09 * std::sqrt(6.0 / 200));
    CHECK(initialMlpParameters(shape, 1, 0.1f) == parameters);
    CHECK(initialMlpParameters(shape, 2, 0.1f) != parameters);
}
