// SPDX-License-Identifier: Apache-2.0
// How undecided a ray is between nothing and a wall: the entropy of what comes through it, and its derivative.
//
//   H(T) = -T ln T - (1 - T) ln(1 - T),   dH_dT = ln((1 - T) / T)
// Source: Sun et al. 2022, "Direct Voxel Grid Optimization", the background entropy loss. It asks thin fog, which photographs of
// places leave open, to be gone.
#pragma once

#include <cmath>

namespace nerfvdb {

/// Nearer than this to 0 or 1 the entropy goes on as a straight line: its slope, at most 6.9, cannot outweigh a photograph.
inline constexpr float kDecided = 1e-3f;

/// dH_dT for a transmittance in [0, 1].
inline float opacityEntropySlope(float transmittance) {
    const float t = std::fmin(std::fmax(transmittance, kDecided), 1 - kDecided);
    return std::log((1 - t) / t);
}

/// H for a transmittance in [0, 1]: 0.69 at a half, at its ends 1e-3 (the line does not reach zero).
inline float opacityEntropy(float transmittance) {
    const float t = std::fmin(std::fmax(transmittance, kDecided), 1 - kDecided);
    return -t * std::log(t) - (1 - t) * std::log1p(-t) + (transmittance - t) * opacityEntropySlope(t);
}

}  // namespace nerfvdb
