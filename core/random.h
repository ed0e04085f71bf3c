// SPDX-License-Identifier: Apache-2.0
// Random numbers as a pure function of (seed, stream, index): no state, so the order of threads cannot matter.
#pragma once

#include <cstdint>

namespace nerfvdb {

/// 64 well-mixed bits of x. Source: Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
/// generators", the SplitMix64 finaliser (variant 13 of Stafford).
inline std::uint64_t mixBits(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ull;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    return x ^ (x >> 31);
}

/// 64 random bits of item `index` in `stream` (a step, say) under `seed`.
inline std::uint64_t randomBits(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
    return mixBits(mixBits(mixBits(seed) ^ stream) ^ index);
}

/// Uniform in [0, 1): the upper 24 bits of a 32-bit word.
inline float unitFloat(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

}  // namespace nerfvdb
