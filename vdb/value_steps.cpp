// SPDX-License-Identifier: Apache-2.0
#include "vdb/value_steps.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"

namespace nerfvdb {
namespace {

constexpr int kFinestExponent = -16, kCoarsestExponent = -4;

// What a sample stops is alpha = 1 - exp(-exp(raw)); its slope by raw is largest where the optical depth is 1.
constexpr double kSteepestAlpha = 0.36787944;  // 1 / e

/// Exponent of the lowest bit that is set in a float's significand; value != 0.
int lowestBit(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    const int exponent = bits >> 23 & 0xff;
    const std::uint32_t significand = (bits & 0x7fffff) | (exponent ? 0x800000u : 0u);
    return std::max(exponent, 1) - 150 + std::countr_zero(significand);
}

/// What rounding may change of one voxel's colour, as a standard deviation in sRGB units: two fifths of the error that
/// the model has anyway. A pixel averages many voxels; of `lego` at 35.7 dB, 0.01 dB is lost. Without a known error,
/// half a level of 8 bits.
double allowedColourError(double train_psnr) {
    if (!(train_psnr > 0)) return 2e-3;
    return std::clamp(0.4 * std::pow(10.0, -train_psnr / 20), 1e-3, 1.2e-2);
}

/// The power of two below a step whose rounding error has this standard deviation, times `slope`.
int exponentFor(double deviation, double slope) {
    return static_cast<int>(std::floor(std::log2(deviation * std::sqrt(12.0) / std::max(slope, 1e-6))));
}

struct ChannelStats {
    float largest = 0;        // magnitude
    int lowest_bit = 128;     // of all values; 128: all are zero
    std::uint32_t code_bits = 0;  // all codes' magnitudes, or-ed
};

/// Calls visit(stats, value) for every channel of every active voxel; the order cannot matter to what is kept.
template <typename Visit, typename Merge>
std::vector<ChannelStats> gatherStats(const VoxelField& field, const Visit& visit, const Merge& merge) {
    const std::size_t leaves = field.topology().leafCount();
    const int channels = field.channels() + 1;
    constexpr std::size_t kGrain = 64;
    std::vector<std::vector<ChannelStats>> parts((leaves + kGrain - 1) / kGrain);
    parallelRanges(leaves, kGrain, [&](std::size_t first, std::size_t last) {
        std::vector<ChannelStats>& part = parts[first / kGrain];
        part.resize(channels);
        for (std::size_t leaf = first; leaf < last; ++leaf)
            forEachBit(field.topology().voxels()[leaf], [&](int offset) {
                for (int k = 0; k < channels; ++k)
                    visit(part[k], k, keptValue(field, leaf * kLeafVoxels + offset, k));
            });
    });
    std::vector<ChannelStats> all(channels);
    for (const auto& part : parts)
        for (int k = 0; k < channels; ++k) merge(all[k], part[k]);
    return all;
}

/// Root mean square slope of a colour channel with respect to each feature, over voxels in proportion to their
/// alpha and over directions: one backward pass with random signs sees the norm of the whole Jacobian
/// (E[(s . J)^2] = |J|^2 for independent signs s).
std::vector<double> colourSlopes(const Model& model) {
    constexpr std::size_t kSamples = 4096;
    constexpr int kBatch = 256;
    const VoxelField& field = model.field;
    const auto channels = static_cast<std::size_t>(field.channels());
    const std::size_t stride = std::max<std::size_t>(1, field.topology().voxelCount() / kSamples);

    std::vector<double> sum(channels, 0.0);
    double weight_sum = 0;
    std::vector<float> features, directions, dl_drgb, weights;
    std::vector<float> rgb(kBatch * 3), dl_dfeatures(kBatch * channels);
    std::vector<float> dl_dparameters(model.decoder.parameters().size());
    Decoder::Workspace work;
    const auto flush = [&] {
        const int n = static_cast<int>(weights.size());
        if (n == 0) return;
        model.decoder.forward(n, features.data(), directions.data(), nullptr, rgb.data(), work);
        model.decoder.backward(n, dl_drgb.data(), dl_dfeatures.data(), nullptr, dl_dparameters, work);
        for (int i = 0; i < n; ++i)
            for (std::size_t k = 0; k < channels; ++k) {
                const double slope = dl_dfeatures[i * channels + k];
                sum[k] += weights[i] * slope * slope;
            }
        for (const float weight : weights) weight_sum += weight;
        for (auto* values : {&features, &directions, &dl_drgb, &weights}) values->clear();
    };

    std::size_t index = 0;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        forEachBit(field.topology().voxels()[leaf], [&](int offset) {
            if (index++ % stride) return;
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            const std::uint64_t bits = randomBits(0, 0, index);
            const float z = 2 * unitFloat(static_cast<std::uint32_t>(bits)) - 1;
            const float angle = 6.2831853f * unitFloat(static_cast<std::uint32_t>(bits >> 32));
            const float r = std::sqrt(1 - z * z);
            directions.insert(directions.end(), {r * std::cos(angle), r * std::sin(angle), z});
            const auto in = field.features().subspan(voxel * channels, channels);
            features.insert(features.end(), in.begin(), in.end());
            const std::uint64_t signs = randomBits(0, 1, index);
            for (int c = 0; c < 3; ++c) dl_drgb.push_back(signs >> c & 1 ? 1.0f : -1.0f);
            const double tau = sigmaFromRaw(field.density()[voxel], field.densityScale()) * field.frame().voxel_size;
            weights.push_back(static_cast<float>(-std::expm1(-tau)));
            if (weights.size() == kBatch) flush();
        });
    flush();
    for (double& value : sum) value = weight_sum > 0 ? std::sqrt(value / (3 * weight_sum)) : 0.0;
    return sum;
}

}  // namespace

StepExponents chooseSteps(const Model& model) {
    const VoxelField& field = model.field;
    const int channels = field.channels();
    const std::vector<ChannelStats> values = gatherStats(
        field,
        [](ChannelStats& stats, int channel, float value) {
            if (!canBeStored(value))
                throw NumericError(channel == 0 ? "density" : "feature channel " + std::to_string(channel - 1),
                                   std::to_string(value) + " in an active voxel", "at most a million",
                                   "training has diverged: nothing was saved");
            stats.largest = std::max(stats.largest, std::abs(value));
            if (value != 0) stats.lowest_bit = std::min(stats.lowest_bit, lowestBit(value));
        },
        [](ChannelStats& all, const ChannelStats& part) {
            all.largest = std::max(all.largest, part.largest);
            all.lowest_bit = std::min(all.lowest_bit, part.lowest_bit);
        });

    // Independent errors of all channels add up, so that each gets 1 / sqrt(channels). Density is judged at its worst:
    // optical depth 1 over a voxel, white before black.
    const double colour_error = allowedColourError(model.info.train_psnr);
    const std::vector<double> slopes = colourSlopes(model);
    StepExponents steps(channels + 1);
    steps[0] = std::min(exponentFor(colour_error, kSteepestAlpha), kCoarsestExponent);
    for (int k = 1; k <= channels; ++k) {
        const int wanted = std::clamp(exponentFor(colour_error / std::sqrt(channels), slopes[k - 1]), kFinestExponent,
                                      kCoarsestExponent);
        // Rounded values have slightly other slopes; the slack keeps them from being rounded again.
        constexpr int kSlack = 2;
        steps[k] = values[k].lowest_bit >= wanted - kSlack ? std::min(values[k].lowest_bit, kCoarsestExponent + kSlack)
                                                           : wanted;
        while (std::ldexp(values[k].largest, -steps[k]) > kMaxCode) ++steps[k];
    }

    // The coarsest step that says the same: what lowestBit finds when the values come back.
    const std::vector<ChannelStats> codes = gatherStats(
        field,
        [&](ChannelStats& stats, int channel, float value) {
            stats.code_bits |= static_cast<std::uint32_t>(std::abs(codeOf(value, steps[channel])));
        },
        [](ChannelStats& all, const ChannelStats& part) { all.code_bits |= part.code_bits; });
    for (int k = 1; k <= channels; ++k)
        steps[k] = codes[k].code_bits ? steps[k] + std::countr_zero(codes[k].code_bits) : 0;
    return steps;
}

}  // namespace nerfvdb
