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
    std::size_t end() const { return bias + static_cast<std::size_t>(n_out); }
};

LayerView layerAt(const MlpShape& shape, std::size_t l, std::size_t begin) {
    const int n_in = shape.widths[l], n_out = shape.widths[l + 1];
    return {n_in, n_out, begin, begin + static_cast<std::size_t>(n_in) * static_cast<std::size_t>(n_out)};
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
    for (std::size_t l = 0, begin = 0; l < shape.layerCount(); ++l) {
        const LayerView layer = layerAt(shape, l, begin);
        const float gain = l + 1 == shape.layerCount() ? output_gain : 1.0f;
        const float bound = gain * std::sqrt(6.0f / static_cast<float>(layer.n_in));
        for (std::size_t i = layer.weights; i < layer.bias; ++i)
            parameters[i] = bound * (2 * unitFloat(static_cast<std::uint32_t>(randomBits(seed, l, i))) - 1);
        begin = layer.end();
    }
    return parameters;
}

void MlpActivations::resize(const MlpShape& shape, int max_batch) {
    // Rows an odd number of cache lines apart: at a power of two, the same few sets of the cache would serve all rows.
    stride = ((max_batch + kPadding - 1) / kPadding | 1) * kPadding;
    offsets.clear();
    std::size_t size = 0;
    for (const int width : shape.widths) {
        offsets.push_back(size);
        size += static_cast<std::size_t>(width) * stride;
    }
    values.assign(size + kPadding, 0.0f);
}

void mlpForward(const MlpShape& shape, std::span<const float> parameters, int batch, MlpActivations& activations) {
    for (std::size_t l = 0, begin = 0; l < shape.layerCount(); ++l) {
        const LayerView layer = layerAt(shape, l, begin);
        simd::layerForward(batch, activations.stride, layer.n_in, layer.n_out, &parameters[layer.weights],
                           &parameters[layer.bias], /*relu=*/l + 1 < shape.layerCount(), activations.layer(l),
                           activations.layer(l + 1));
        begin = layer.end();
    }
}

void mlpBackward(const MlpShape& shape, std::span<const float> parameters, int batch, MlpActivations& activations,
                 MlpActivations& gradients, std::span<float> dl_dparameters) {
    std::size_t end = shape.parameterCount();
    for (std::size_t l = shape.layerCount(); l-- > 0;) {
        const std::size_t size = static_cast<std::size_t>(shape.widths[l] + 1) * static_cast<std::size_t>(shape.widths[l + 1]);
        const LayerView layer = layerAt(shape, l, end - size);
        end -= size;
        simd::layerBackwardWeights(batch, activations.stride, layer.n_in, layer.n_out, gradients.layer(l + 1),
                                   activations.layer(l), &dl_dparameters[layer.weights],
                                   &dl_dparameters[layer.bias]);
        simd::layerBackwardInput(batch, activations.stride, layer.n_in, layer.n_out, &parameters[layer.weights],
                                 gradients.layer(l + 1), l > 0 ? activations.layer(l) : nullptr,
                                 gradients.layer(l));
    }
}

}  // namespace nerfvdb
