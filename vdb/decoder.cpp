// SPDX-License-Identifier: Apache-2.0
#include "vdb/decoder.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/simd/kernels.h"
#include "core/spherical_harmonics.h"

namespace nerfvdb {
namespace {

constexpr float kOutputGain = 0.1f;  // a small correction of the base colour

float sigmoid(float x) { return 1.0f / (1.0f + std::exp(-x)); }

int rowAt(const std::int32_t* rows, int i) { return rows ? rows[i] : i; }

}  // namespace

Decoder::Decoder(int channels, std::uint64_t seed, int width)
    : channels_(channels), shape_{{channels + kSphericalHarmonics + 1, width, width, 3}} {
    if (channels != 4 && channels != 8 && channels != 16)
        throw UsageError("decoder: the number of feature channels must be 4, 8 or 16");
    if (width < 1 || width > kMaxDecoderWidth) throw UsageError("decoder: its width must be 1 to 1024");
    parameters_ = initialMlpParameters(shape_, seed, kOutputGain);
}

void Decoder::clearOutputLayer() {
    const std::size_t layer = static_cast<std::size_t>(shape_.widths[shape_.layerCount() - 1] + 1) * 3;
    std::fill(parameters_.end() - static_cast<std::ptrdiff_t>(layer), parameters_.end(), 0.0f);
}

void Decoder::forward(int n, const float* features, const float* direction, const float* transmittance, float* rgb,
                      Workspace& work, const std::int32_t* rows) const {
    if (work.activations.stride < n || work.shape != shape_) {
        work.shape = shape_;
        work.activations.resize(shape_, n);
        work.gradients.resize(shape_, n);
        work.rgb.assign(std::size_t{3} * work.activations.stride, 0.0f);
    }
    const int stride = work.activations.stride;
    float* const input = work.activations.layer(0);
    for (int i = 0; i < n; ++i) {
        const int row = rowAt(rows, i);
        for (int c = 0; c < channels_; ++c) input[c * stride + i] = features[row * channels_ + c];
        sphericalHarmonics(direction[row * 3], direction[row * 3 + 1], direction[row * 3 + 2],
                           input + channels_ * stride + i, stride);
        input[(channels_ + kSphericalHarmonics) * stride + i] = transmittance ? 1 - transmittance[row] : 1.0f;
    }
    mlpForward(shape_, parameters_, n, work.activations);
    const float* const output = work.activations.layer(shape_.layerCount());
    for (int c = 0; c < 3; ++c)
        for (int i = 0; i < n; ++i)
            rgb[rowAt(rows, i) * 3 + c] = work.rgb[c * stride + i] =
                sigmoid(input[c * stride + i] + output[c * stride + i]);
}

void Decoder::backward(int n, const float* dl_drgb, float* dl_dfeatures, float* dl_dtransmittance,
                       std::span<float> dl_dparameters, Workspace& work, const std::int32_t* rows) const {
    const int stride = work.activations.stride;
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    float* const dl_doutput = work.gradients.layer(shape_.layerCount());
    for (int c = 0; c < 3; ++c) {
        for (int i = 0; i < n; ++i) {
            const float value = work.rgb[c * stride + i];
            dl_doutput[c * stride + i] = dl_drgb[rowAt(rows, i) * 3 + c] * value * (1 - value);
        }
        for (int i = n; i < padded; ++i) dl_doutput[c * stride + i] = 0;
    }
    mlpBackward(shape_, parameters_, n, work.activations, work.gradients, dl_dparameters);
    const float* const dl_dinput = work.gradients.layer(0);
    for (int i = 0; i < n; ++i)
        for (int c = 0; c < channels_; ++c)
            dl_dfeatures[rowAt(rows, i) * channels_ + c] =
                dl_dinput[c * stride + i] + (c < 3 ? dl_doutput[c * stride + i] : 0.0f);
    if (!dl_dtransmittance) return;
    const float* const dl_dopacity = dl_dinput + (channels_ + kSphericalHarmonics) * stride;
    for (int i = 0; i < n; ++i) dl_dtransmittance[rowAt(rows, i)] -= dl_dopacity[i];
}

void Decoder::diffuse(int n, const float* features, float* rgb) const {
    // Directions spread evenly: the Fibonacci lattice (Gonzalez 2010, "Measurement of areas on a sphere").
    constexpr int kDirections = 32;
    constexpr int kBatch = 128;
    constexpr double kGoldenAngle = 2.399963229728653;
    Workspace work;
    std::vector<float> direction(std::size_t{3} * kBatch), colour(std::size_t{3} * kBatch);
    for (int first = 0; first < n; first += kBatch) {
        const int batch = std::min(kBatch, n - first);
        std::fill_n(rgb + std::size_t{3} * first, 3 * batch, 0.0f);
        for (int d = 0; d < kDirections; ++d) {
            const double z = 1 - (2 * d + 1.0) / kDirections, radius = std::sqrt(1 - z * z);
            for (int i = 0; i < batch; ++i) {
                direction[i * 3] = static_cast<float>(radius * std::cos(kGoldenAngle * d));
                direction[i * 3 + 1] = static_cast<float>(radius * std::sin(kGoldenAngle * d));
                direction[i * 3 + 2] = static_cast<float>(z);
            }
            forward(batch, features + std::size_t(first) * channels_, direction.data(), nullptr, colour.data(),
                    work);
            for (int i = 0; i < 3 * batch; ++i) rgb[std::size_t{3} * first + i] += colour[i] / kDirections;
        }
    }
}

}  // namespace nerfvdb
