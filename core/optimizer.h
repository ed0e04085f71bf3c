// SPDX-License-Identifier: Apache-2.0
// Optimiser of small dense parameter sets (the network). Voxels have their own, fused with the scatter:
// rmsPropLeaf in simd/kernels.h.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "core/simd/kernels.h"

namespace nerfvdb {

/// Adam (Kingma and Ba 2015, algorithm 1), with bias correction.
struct Adam {
    float beta1 = 0.9f, beta2 = 0.99f, epsilon = 1e-8f;
    std::vector<float> first, second;  // moments
    std::int64_t count = 0;            // steps done

    /// parameters -= rate * m / (sqrt(v) + epsilon); all spans of one size.
    void step(std::span<float> parameters, std::span<const float> gradients, float rate) {
        first.resize(parameters.size());
        second.resize(parameters.size());
        ++count;
        const double correction1 = 1 - std::pow(static_cast<double>(beta1), static_cast<double>(count));
        const double correction2 = 1 - std::pow(static_cast<double>(beta2), static_cast<double>(count));
        const float scale1 = static_cast<float>(1 / correction1), scale2 = static_cast<float>(1 / correction2);
        // Ranges of whole vectors: which values take the scalar way follows from their number alone.
        parallelRanges(parameters.size(), 1 << 14, [&](std::size_t begin, std::size_t end) {
            simd::adamStep(static_cast<int>(end - begin), {beta1, beta2, epsilon, rate, scale1, scale2},
                           gradients.data() + begin, first.data() + begin, second.data() + begin,
                           parameters.data() + begin);
        });
    }
};

}  // namespace nerfvdb
