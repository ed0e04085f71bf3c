// SPDX-License-Identifier: Apache-2.0
// How finely learned values are kept: one step per channel, a power of two.
// Why not 8 bits a value, or a scale per block: for a given mean squared error, a uniform step followed by entropy
// coding spends the fewest bits (Gish and Pierce 1968, "Asymptotically efficient quantizing"), and multiples of a
// power of two are exact in float, so that rounding twice is rounding once.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdb/model.h"

namespace nerfvdb {

/// Values are multiples of 2^exponent; one exponent for density, then one per feature channel: [1 + channels].
using StepExponents = std::vector<int>;

/// What a file may hold, in magnitude, of learned values and of weights: far more than training makes (thousands), and too little
/// for a sum to overflow in three layers of kMaxDecoderWidth.
inline constexpr float kMaxStored = 1e6f;
inline bool canBeStored(float value) { return std::abs(value) <= kMaxStored; }  // false for NaN

inline constexpr int kMaxCode = 32767;  // |value| <= kMaxCode * 2^exponent

inline int codeOf(float value, int exponent) { return static_cast<int>(std::lrint(std::ldexp(value, -exponent))); }
inline float valueOf(int code, int exponent) { return std::ldexp(static_cast<float>(code), exponent); }

/// What is kept of a voxel's channel before rounding: 0 is raw density, clamped to [kEmptyRaw, kMaxRaw] (beyond
/// which nothing can be seen), k is feature k - 1. NaN and infinity stay what they are.
inline float keptValue(const VoxelField& field, std::size_t voxel, int channel) {
    if (channel > 0) return field.features()[voxel * static_cast<std::size_t>(field.channels()) + (channel - 1)];
    const float raw = field.density()[voxel];
    return std::isfinite(raw) ? std::clamp(raw, kEmptyRaw, kMaxRaw) : raw;
}

/// The steps to which a model's values can be rounded without a visible change: density by how much the light that a
/// voxel stops may change, features by how strongly the decoder reacts to each channel. Values that are multiples of
/// such a step already keep theirs, so that rounded models are not rounded again.
/// Throws NumericError when an active voxel holds NaN, infinity, or a feature of more than kMaxStored.
StepExponents chooseSteps(const Model& model);

}  // namespace nerfvdb
