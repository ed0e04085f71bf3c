// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_decoder.h"

#include <algorithm>
#include <cmath>

#include "bench/ray_reference.h"
#include "core/random.h"
#include "core/spherical_harmonics.h"
#include "vdb/decoder.h"

namespace nerfvdb {
namespace {

constexpr double kRounding = 0x1p-24;
using Values = std::vector<Exact>;

float random(float low, float high, std::uint64_t seed, std::uint64_t index) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 15, index)));
}

/// A value and the sum of the magnitudes of the terms that it was made of, all the way from the input.
struct Layer {
    Values value, terms;
};

/// The decoder of one ray, written out.
struct ExactDecoder {
    std::vector<Layer> layers;  // inputs of each layer, and the last one's output, before the sigmoid
    std::vector<Values> inner;  // of each hidden layer, before its ReLU
    Values rgb;
    bool is_near_kink = false;  // a ReLU whose input is within rounding of 0: its slope is anyone's guess

    ExactDecoder(const Decoder& decoder, const Values& input) {
        const std::vector<int>& widths = decoder.shape().widths;
        const float* weights = decoder.parameters().data();
        Layer at{input, input};
        for (Exact& term : at.terms) term = std::abs(term);
        layers.push_back(at);
        for (std::size_t l = 0; l + 1 < widths.size(); ++l) {
            const int n_in = widths[l], n_out = widths[l + 1];
            const float* const bias = weights + n_in * n_out;
            Layer next;
            for (int o = 0; o < n_out; ++o) {
                Exact sum = bias[o], terms = std::abs(static_cast<Exact>(bias[o]));
                for (int i = 0; i < n_in; ++i) {
                    sum += weights[o * n_in + i] * at.value[i];
                    terms += std::abs(weights[o * n_in + i] * at.terms[i]);
                }
                next.value.push_back(sum), next.terms.push_back(terms);
            }
            weights = bias + n_out;
            if (l + 2 < widths.size()) {
                inner.push_back(next.value);
                for (std::size_t o = 0; o < next.value.size(); ++o) {
                    is_near_kink = is_near_kink || std::abs(next.value[o]) < 500 * kRounding * next.terms[o];
                    next.value[o] = std::max(next.value[o], Exact{0});
                }
            }
            layers.push_back(next);
            at = next;
        }
        for (std::size_t c = 0; c < 3; ++c)
            rgb.push_back(1 / (1 + std::exp(-(layers.front().value[c] + layers.back().value[c]))));
    }
};

/// dl_dinput, and dl_dparameters added up, from dl_drgb; with terms.
void exactBackward(const Decoder& decoder, const ExactDecoder& forward, const Values& dl_drgb, Layer& dl_dinput,
                   Layer& dl_dparameters) {
    const std::vector<int>& widths = decoder.shape().widths;
    Layer slope;
    for (std::size_t c = 0; c < 3; ++c) {
        // Near 0 and 1 single precision knows 1 - rgb to its rounding only.
        slope.value.push_back(dl_drgb[c] * forward.rgb[c] * (1 - forward.rgb[c]));
        slope.terms.push_back(std::abs(dl_drgb[c]) * forward.rgb[c]);
    }
    const Layer output = slope;
    std::size_t end = decoder.parameters().size();
    for (std::size_t l = widths.size() - 1; l-- > 0;) {
        const auto n_in = static_cast<std::size_t>(widths[l]), n_out = static_cast<std::size_t>(widths[l + 1]);
        const std::size_t begin = end - (n_in + 1) * n_out;
        Layer below{Values(n_in), Values(n_in)};
        for (std::size_t o = 0; o < n_out; ++o) {
            if (l + 2 < widths.size() && !(forward.inner[l][o] > 0)) slope.value[o] = slope.terms[o] = 0;
            for (std::size_t i = 0; i < n_in; ++i) {
                const std::size_t w = begin + o * n_in + i;
                const Exact weight = decoder.parameters()[w];
                below.value[i] += weight * slope.value[o];
                below.terms[i] += std::abs(weight) * slope.terms[o];
                dl_dparameters.value[w] += slope.value[o] * forward.layers[l].value[i];
                dl_dparameters.terms[w] += slope.terms[o] * forward.layers[l].terms[i];
            }
            dl_dparameters.value[begin + n_in * n_out + o] += slope.value[o];
            dl_dparameters.terms[begin + n_in * n_out + o] += slope.terms[o];
        }
        slope = below;
        end = begin;
    }
    dl_dinput = slope;
    for (std::size_t c = 0; c < 3; ++c)
        dl_dinput.value[c] += output.value[c], dl_dinput.terms[c] += output.terms[c];
}

}  // namespace

std::vector<StressRow> stressDecoder(Report& report) {
    const char* const kWhy = "a rounding for each term of the longest path, 2 (widths + 20)";
    StressRow colour("decoder", "colour", "the sigmoid's slope, 1/4, times the roundings of its input's terms");
    StressRow inputs("decoder", "gradient of features and opacity, share of its terms", kWhy);
    StressRow network("decoder", "gradient of the network, share of its terms", kWhy);
    StressRow finite("decoder", "NaN or infinity, features to 1e8", "none");
    report.begin("decoder", 0);
    constexpr int kRays = 37;
    for (const int channels : {4, 8, 16})
        for (const int width : {1, 17, 128})
            for (const float size : {0.01f, 1.0f, 30.0f}) {
                Decoder decoder(channels, 3, width);
                std::span<float> parameters = decoder.parameters();
                for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i] += random(-0.1f, 0.1f, 1, i);
                std::vector<float> features(kRays * channels), direction(3 * kRays), transmittance(kRays),
                    rgb(3 * kRays);
                for (std::size_t i = 0; i < features.size(); ++i) features[i] = random(-size, size, 2, i);
                std::vector<float> dl_drgb(3 * kRays), dl_dfeatures(features.size()), dl_dtransmittance(kRays),
                    dl_dparameters(parameters.size());
                for (int r = 0; r < kRays; ++r) {
                    const auto at = static_cast<std::uint64_t>(r);
                    const Vec3d d =
                        Vec3d(random(-1, 1, 3, at), random(-1, 1, 4, at), random(-1, 1, 5, at)).normalized();
                    for (int c = 0; c < 3; ++c) {
                        direction[3 * r + c] = static_cast<float>(d[c]);
                        dl_drgb[3 * r + c] = random(-1, 1, 6, 3 * at + static_cast<std::uint64_t>(c));
                    }
                    transmittance[r] = r % 5 == 0 ? 0.0f : random(0, 1, 7, at);
                }
                Decoder::Workspace work;
                decoder.forward(kRays, features.data(), direction.data(), transmittance.data(), rgb.data(),
                                work);
                decoder.backward(kRays, dl_drgb.data(), dl_dfeatures.data(), dl_dtransmittance.data(),
                                 dl_dparameters, work);

                Layer dl_dnetwork{Values(parameters.size()), Values(parameters.size())};
                const double error = 2 * (channels + 17 + 2 * width + 20 + kRays) * kRounding;
                bool has_kink = false;
                for (int r = 0; r < kRays; ++r) {
                    Values input(features.begin() + r * channels, features.begin() + (r + 1) * channels);
                    float harmonics[kSphericalHarmonics];
                    sphericalHarmonics(direction[3 * r], direction[3 * r + 1], direction[3 * r + 2], harmonics,
                                       1);
                    input.insert(input.end(), harmonics, harmonics + kSphericalHarmonics);
                    input.push_back(1 - static_cast<Exact>(transmittance[r]));
                    const ExactDecoder exact(decoder, input);
                    for (std::size_t c = 0; c < 3; ++c) {
                        const Exact terms = exact.layers.front().terms[c] + exact.layers.back().terms[c];
                        colour.add(static_cast<double>(std::abs(rgb[3 * r + c] - exact.rgb[c])),
                                   0.25 * error * static_cast<double>(terms) + 4 * kRounding);
                    }
                    Layer dl_dinput;
                    exactBackward(decoder, exact, Values(&dl_drgb[3 * r], &dl_drgb[3 * r] + 3), dl_dinput,
                                  dl_dnetwork);
                    has_kink = has_kink || exact.is_near_kink;
                    if (exact.is_near_kink) continue;
                    // The slope of the sigmoid moves with its input's error.
                    const double moved = error * (1 + static_cast<double>(exact.layers.back().terms[0] + size));
                    const auto judge = [&](float found, std::size_t i) {
                        if (dl_dinput.terms[i] > 0)
                            inputs.add(
                                static_cast<double>(std::abs(found - dl_dinput.value[i]) / dl_dinput.terms[i]),
                                moved);
                    };
                    for (int c = 0; c < channels; ++c)
                        judge(dl_dfeatures[r * channels + c], static_cast<std::size_t>(c));
                    judge(-dl_dtransmittance[r], input.size() - 1);
                }
                if (!has_kink)
                    for (std::size_t i = 0; i < parameters.size(); ++i)
                        if (dl_dnetwork.terms[i] > 0)
                            network.add(static_cast<double>(std::abs(dl_dparameters[i] - dl_dnetwork.value[i]) /
                                                            dl_dnetwork.terms[i]),
                                        error * (1 + static_cast<double>(size) * width));
                for (float& value : features) value *= 1e8f / size;
                std::fill(dl_dtransmittance.begin(), dl_dtransmittance.end(), 0.0f);
                decoder.forward(kRays, features.data(), direction.data(), transmittance.data(), rgb.data(),
                                work);
                decoder.backward(kRays, dl_drgb.data(), dl_dfeatures.data(), dl_dtransmittance.data(),
                                 dl_dparameters, work);
                const auto holds = [](const std::vector<float>& values) {
                    return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
                };
                finite.check(holds(rgb) && holds(dl_dfeatures) && holds(dl_dtransmittance) &&
                             holds(dl_dparameters));
            }
    report.end();
    return {colour, inputs, network, finite};
}

}  // namespace nerfvdb
