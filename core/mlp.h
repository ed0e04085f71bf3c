// SPDX-License-Identifier: Apache-2.0
// A small fully connected network with ReLU between layers. Batches are stored
// channel-major, [channel][sample], so that lanes are samples and no value is ever shuffled.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace nerfvdb {

/// Layer widths from input to output, for example {32, 64, 64, 3}. Parameters, layer by layer:
/// weights [out][in], then bias [out].
struct MlpShape {
    std::vector<int> widths;

    std::size_t layerCount() const { return widths.size() - 1; }
    std::size_t parameterCount() const;
    bool operator==(const MlpShape&) const = default;
};

/// Kaiming-uniform weights (He et al. 2015, eq. 10, fan-in), zero biases; the last layer is scaled by
/// `output_gain`, so that training starts from a small output. A pure function of seed.
std::vector<float> initialMlpParameters(const MlpShape& shape, std::uint64_t seed, float output_gain);

/// Activations of every layer for one batch; `stride` floats per channel row (a multiple of 16, >= batch).
struct MlpActivations {
    void resize(const MlpShape& shape, int max_batch);
    float* layer(std::size_t l) { return values.data() + offsets[l]; }  // [widths[l]][stride]
    int stride = 0;
    std::vector<std::size_t> offsets;
    std::vector<float> values;
};

/// Reads activations.layer(0), fills the others; the last one holds the output before any activation.
/// Needs batch <= stride; samples from batch up to the next multiple of 16 are computed and ignored.
void mlpForward(const MlpShape& shape, std::span<const float> parameters, int batch, MlpActivations& activations);

/// Backward of mlpForward. `gradients.layer(last)` holds dl_doutput [out][stride], zero for samples >= batch;
/// fills gradients.layer(0) with dl_dinput and adds to dl_dparameters (same layout as parameters).
void mlpBackward(const MlpShape& shape, std::span<const float> parameters, int batch,
                 MlpActivations& activations, MlpActivations& gradients, std::span<float> dl_dparameters);

}  // namespace nerfvdb
