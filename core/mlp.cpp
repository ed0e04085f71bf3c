// SPDX-License-Identifier: Apache-2.0
#include "core/mlp.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/simd/kernels.h"

namespace nerfvdb {
namespace {

/// Where a layer's weights and bias stand in the parameters.
struct LayerView {
    int n_in, n_out;
    std::size_t weights, bias;
};

std::vector<LayerView> layersOf(const MlpShape& shape) {
    std::vector<LayerView> layers;
    std::size_t offset = 0;
    for (std::size_t l = 0; l < shape.layerCount(); ++l) {
        const int n_in = shape.widths[l], n_out = shape.widths[l + 1];
        const std::size_t n_weights = static_cast<std::size_t>(n_in) * n_out;
        layers.push_back({n_in, n_out, offset, offset + n_weights});
        offset += n_weights + static_cast<std::size_t>(n_out);
    }
    return layers;
}

}  // namespace

std::size_t MlpShape::parameterCount() const {
    std::size_t n = 0;
    for (std::size_t l = 0; l + 1 < widths.size(); ++l)
        n += static_cast<std::size_t>(widths[l] + 1) * static_cast<std::size_t>(widths[l + 1]);
    return n;
}

std::vector<float> initialMlpParameters(const MlpShape& shape, std::uint64_t seed, float output_gain) {
    std::vector<float> parameters(shape.parameterCount(), 0.0f);
    const std::vector<LayerView> layers = layersOf(shape);
    for (std::size_t l = 0; l < layers.size(); ++l) {
        const float gain = l + 1 == layers.size() ? output_gain : 1.0f;
        const float bound = gain * std::sqrt(6.0f / static_cast<float>(layers[l].n_in));
        for (std::size_t i = layers[l].weights; i < layers[l].bias; ++i)
            parameters[i] = bound * (2 * unitFloat(static_cast<std::uint32_t>(randomBits(seed, l, i))) - 1);
    }
    return parameters;
}

void MlpActivations::resize(const MlpShape& shape, int max_batch) {
    stride = (max_batch + kPadding - 1) / kPadding * kPadding;
    offsets.clear();
    std::size_t size = 0;
    for (const int width : shape.widths) {
        offsets.push_back(size);
        size += static_cast<std::size_t>(width) * stride;
    }
    values.assign(size + kPadding, 0.0f);
}

void mlpForward(const MlpShape& shape, std::span<const float> parameters, int batch, MlpActivations& activations) {
    const std::vector<LayerView> layers = layersOf(shape);
    for (std::size_t l = 0; l < layers.size(); ++l)
        simd::layerForward(batch, activations.stride, layers[l].n_in, layers[l].n_out,
                           &parameters[layers[l].weights], &parameters[layers[l].bias],
                           /*relu=*/l + 1 < layers.size(), activations.layer(l), activations.layer(l + 1));
}

void mlpBackward(const MlpShape& shape, std::span<const float> parameters, int batch, MlpActivations& activations,
                 MlpActivations& gradients, std::span<float> dl_dparameters) {
    const std::vector<LayerView> layers = layersOf(shape);
    for (std::size_t l = layers.size(); l-- > 0;) {
        const LayerView& layer = layers[l];
        simd::layerBackwardWeights(batch, activations.stride, layer.n_in, layer.n_out, gradients.layer(l + 1),
                                   activations.layer(l), &dl_dparameters[layer.weights],
                                   &dl_dparameters[layer.bias]);
        simd::layerBackwardInput(batch, activations.stride, layer.n_in, layer.n_out, &parameters[layer.weights],
                                 gradients.layer(l + 1), l > 0 ? activations.layer(l) : nullptr,
                                 gradients.layer(l));
    }
}

}  // namespace nerfvdb
