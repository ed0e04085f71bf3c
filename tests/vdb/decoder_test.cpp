// SPDX-License-Identifier: Apache-2.0
#include "vdb/decoder.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/spherical_harmonics.h"
#include "tests/support/catch.h"
#include "tests/support/central_difference.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;
using test::randomIn;

namespace {

constexpr int kRays = 19;  // no multiple of a vector

std::vector<float> randomDirections(int n) {
    std::vector<float> directions;
    for (int i = 0; i < n; ++i) {
        const Vec3f d =
            Vec3f(randomIn(-1, 1, 1, 3 * i), randomIn(-1, 1, 1, 3 * i + 1), randomIn(-1, 1, 1, 3 * i + 2));
        for (int axis = 0; axis < 3; ++axis) directions.push_back(d.normalized()[axis]);
    }
    return directions;
}

/// rgb = sigmoid(F[0..2] + MLP(F, Y(direction), 1 - T)) of one ray, plainly and in double.
Vec3d slowColour(const Decoder& decoder, const std::vector<double>& parameters, const double* features,
                 const float* direction, double transmittance) {
    const std::vector<int>& widths = decoder.shape().widths;
    std::vector<double> in(features, features + decoder.channels());
    float harmonics[kSphericalHarmonics];
    sphericalHarmonics(direction[0], direction[1], direction[2], harmonics);
    in.insert(in.end(), harmonics, harmonics + kSphericalHarmonics);
    in.push_back(1 - transmittance);
    std::size_t offset = 0;
    for (std::size_t l = 0; l + 1 < widths.size(); ++l) {
        std::vector<double> out(widths[l + 1]);
        for (int o = 0; o < widths[l + 1]; ++o) {
            out[o] = parameters[offset + static_cast<std::size_t>(widths[l]) * widths[l + 1] + o];
            for (int i = 0; i < widths[l]; ++i) out[o] += parameters[offset + o * widths[l] + i] * in[i];
            if (l + 2 < widths.size()) out[o] = std::max(out[o], 0.0);
        }
        offset += static_cast<std::size_t>(widths[l] + 1) * widths[l + 1];
        in = out;
    }
    Vec3d rgb;
    for (int c = 0; c < 3; ++c) rgb[c] = 1 / (1 + std::exp(-(features[c] + in[c])));
    return rgb;
}

/// A decoder whose network matters, with everything that a gradient check needs.
struct Checked {
    Decoder decoder;
    std::vector<double> parameters, features, transmittance;
    std::vector<float> directions = randomDirections(kRays), dl_drgb;

    explicit Checked(int channels) : decoder(channels, 5) {
        for (std::size_t i = 0; i < decoder.parameters().size(); ++i)
            decoder.parameters()[i] += randomIn(-0.1f, 0.1f, 2, i);
        parameters.assign(decoder.parameters().begin(), decoder.parameters().end());
        for (int i = 0; i < kRays * channels; ++i) features.push_back(randomIn(-2, 2, 3, i));
        for (int i = 0; i < kRays; ++i) transmittance.push_back(randomIn(0, 1, 7, i));
        for (int i = 0; i < kRays * 3; ++i) dl_drgb.push_back(randomIn(-1, 1, 4, i));
    }
    double loss() const {
        double sum = 0;
        for (int r = 0; r < kRays; ++r) {
            const Vec3d rgb =
                slowColour(decoder, parameters, &features[r * decoder.channels()], &directions[3 * r], transmittance[r]);
            for (int c = 0; c < 3; ++c) sum += rgb[c] * dl_drgb[3 * r + c];
        }
        return sum;
    }
    double derivative(double& variable) const {
        constexpr double kStep = 1e-6;  // curvature adds 1e-12, rounding 1e-16 * 10 / 1e-6
        return test::centralDifference([&] { return loss(); }, variable, kStep);
    }
};

// Single-precision sums of up to 128 + 25 terms of order 1, through three layers.
constexpr double kTolerance = 5e-5;

}  // namespace

TEST_CASE("decoded colours agree with the formula in double, for 4, 8 and 16 channels") {
    for (const int channels : {4, 8, 16}) {
        const Checked c(channels);
        const std::vector<float> features(c.features.begin(), c.features.end());
        const std::vector<float> transmittance(c.transmittance.begin(), c.transmittance.end());
        Decoder::Workspace work;
        std::vector<float> rgb(3 * kRays);
        c.decoder.forward(kRays, features.data(), c.directions.data(), transmittance.data(), rgb.data(), work);
        for (int r = 0; r < kRays; ++r) {
            const Vec3d expected =
                slowColour(c.decoder, c.parameters, &c.features[r * channels], &c.directions[3 * r], c.transmittance[r]);
            for (int k = 0; k < 3; ++k) CHECK(rgb[3 * r + k] == Approx(expected[k]).margin(kTolerance));
        }
    }
}

TEST_CASE("the decoder's gradients agree with central differences: features and every parameter section") {
    Checked c(8);
    const std::vector<float> features(c.features.begin(), c.features.end());
    const std::vector<float> transmittance(c.transmittance.begin(), c.transmittance.end());
    Decoder::Workspace work;
    std::vector<float> rgb(3 * kRays), dl_dfeatures(kRays * 8, 1e30f), dl_dtransmittance(kRays, 0.5f),
        dl_dparameters(c.parameters.size(), 0.0f);
    c.decoder.forward(kRays, features.data(), c.directions.data(), transmittance.data(), rgb.data(), work);
    c.decoder.backward(kRays, c.dl_drgb.data(), dl_dfeatures.data(), dl_dtransmittance.data(), dl_dparameters, work);

    int wrong = 0;
    for (int i = 0; i < kRays * 8; ++i)
        wrong += !(std::abs(dl_dfeatures[i] - c.derivative(c.features[i])) <= kTolerance);
    for (int r = 0; r < kRays; ++r)  // added to what was there
        wrong += !(std::abs(dl_dtransmittance[r] - 0.5 - c.derivative(c.transmittance[r])) <= kTolerance);
    CHECK(wrong == 0);

    // A kink of a ReLU within the difference's step may spoil a derivative: at most one in a thousand.
    const std::vector<int>& widths = c.decoder.shape().widths;
    std::size_t offset = 0;
    for (std::size_t l = 0; l + 1 < widths.size(); ++l)
        for (const auto& [section, n] :
             {std::pair{"weights", static_cast<std::size_t>(widths[l]) * widths[l + 1]},
              {"bias", static_cast<std::size_t>(widths[l + 1])}}) {
            CAPTURE(l, section);
            const std::size_t stride = n > 500 ? 7 : 1;
            double largest = 0;
            wrong = 0;
            for (std::size_t i = offset; i < offset + n; i += stride) {
                const double expected = c.derivative(c.parameters[i]);
                largest = std::max(largest, std::abs(expected));
                wrong += !(std::abs(dl_dparameters[i] - expected) <= kTolerance);
            }
            CHECK(wrong <= static_cast<int>(n / stride / 1000));
            CHECK(largest > 0.01);  // or nothing was tested
            offset += n;
        }
    CHECK(offset == c.parameters.size());
}

TEST_CASE("a workspace used for many rays serves few as well: leftovers have no gradient") {
    const Checked c(4);
    const std::vector<float> features(c.features.begin(), c.features.end());
    const std::vector<float> transmittance(c.transmittance.begin(), c.transmittance.end());
    const auto gradientOfTwoRays = [&](Decoder::Workspace& work) {
        std::vector<float> rgb(3 * kRays), dl_dfeatures(kRays * 4), dl_dparameters(c.parameters.size());
        c.decoder.forward(2, features.data(), c.directions.data(), transmittance.data(), rgb.data(), work);
        c.decoder.backward(2, c.dl_drgb.data(), dl_dfeatures.data(), nullptr, dl_dparameters, work);
        return dl_dparameters;
    };
    Decoder::Workspace fresh, used;
    std::vector<float> rgb(3 * kRays), dl_dfeatures(kRays * 4), ignored(c.parameters.size());
    c.decoder.forward(kRays, features.data(), c.directions.data(), transmittance.data(), rgb.data(), used);
    c.decoder.backward(kRays, c.dl_drgb.data(), dl_dfeatures.data(), nullptr, ignored, used);
    CHECK(gradientOfTwoRays(fresh) == gradientOfTwoRays(used));
}

TEST_CASE("with its output layer cleared, a decoder shows the base colour from everywhere, and learns from there") {
    Decoder decoder(8, 3, 32);
    decoder.clearOutputLayer();
    const std::vector<float> directions = randomDirections(kRays);
    std::vector<float> features(8 * kRays), rgb(3 * kRays), dl_drgb(3 * kRays, 1.0f), dl_dfeatures(8 * kRays);
    for (std::size_t i = 0; i < features.size(); ++i) features[i] = randomIn(-3, 3, 4, i);
    Decoder::Workspace work;
    decoder.forward(kRays, features.data(), directions.data(), nullptr, rgb.data(), work);
    for (int i = 0; i < kRays; ++i)
        for (int c = 0; c < 3; ++c)
            CHECK(rgb[3 * i + c] == Approx(1 / (1 + std::exp(-features[8 * i + c]))).margin(1e-6));

    // What is before the output layer has no slope yet; the output layer has, so that the next step finds one.
    std::vector<float> dl_dparameters(decoder.parameters().size(), 0.0f);
    decoder.backward(kRays, dl_drgb.data(), dl_dfeatures.data(), nullptr, dl_dparameters, work);
    const auto output = dl_dparameters.end() - (32 + 1) * 3;
    const auto is_zero = [](float slope) { return slope == 0; };
    CHECK(std::all_of(dl_dparameters.begin(), output, is_zero));
    CHECK(std::none_of(dl_dparameters.end() - 3, dl_dparameters.end(), is_zero));
    CHECK(std::count_if(output, dl_dparameters.end(), is_zero) < 3 * 32 / 2);
}

TEST_CASE("diffuse colour is the mean over all directions") {
    const Checked c(8);
    constexpr int kPoints = 130;  // more than one batch
    std::vector<float> features;
    std::vector<double> exact;
    for (int i = 0; i < kPoints * 8; ++i) features.push_back(randomIn(-2, 2, 6, i));
    exact.assign(features.begin(), features.end());
    std::vector<float> rgb(3 * kPoints);
    c.decoder.diffuse(kPoints, features.data(), rgb.data());
    for (const int point : {0, 1, 127, 128, 129}) {
        // The mean over 4000 directions of an independent set (equal steps of z and of azimuth).
        Vec3d mean = Vec3d::Zero(), least = Vec3d::Ones(), most = Vec3d::Zero();
        for (int i = 0; i < 4000; ++i) {
            const double z = (i / 80 + 0.5) / 25 - 1, radius = std::sqrt(1 - z * z),
                         azimuth = i % 80 * (M_PI / 40);
            const float direction[3] = {static_cast<float>(radius * std::cos(azimuth)),
                                        static_cast<float>(radius * std::sin(azimuth)), static_cast<float>(z)};
            const Vec3d colour = slowColour(c.decoder, c.parameters, &exact[point * 8], direction, 0);
            mean += colour / 4000;
            least = least.cwiseMin(colour), most = most.cwiseMax(colour);
        }
        for (int k = 0; k < 3; ++k) {
            // 32 directions know the mean of a cubic polynomial well; ReLUs bend it: 3 % of the range is left.
            CHECK(std::abs(rgb[3 * point + k] - mean[k]) < 0.03 * (most[k] - least[k]));
            CHECK(most[k] - least[k] > 0.005);  // or nothing depends on direction
        }
    }
}

TEST_CASE("a decoder refuses numbers of channels that no kernel has") {
    for (const int channels : {0, 3, 5, 32}) CHECK_THROWS_AS(Decoder(channels, 1), UsageError);
}
