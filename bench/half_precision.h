// SPDX-License-Identifier: Apache-2.0
// What 16 bits a value would keep, tried on values that stay floats.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

namespace nerfvdb {

/// The nearest number of half precision (IEEE 754 binary16): 11 digits, not below 2^-24. Beyond 65504, its largest, and what is
/// not finite stays as it is.
inline float inHalfPrecision(float value) {
    if (!(std::abs(value) <= 65504)) return value;
    int exponent;
    std::frexp(value, &exponent);
    const int last_digit = std::max(exponent - 11, -24);
    return std::ldexp(std::nearbyint(std::ldexp(value, -last_digit)), last_digit);
}

inline void storeInHalfPrecision(std::span<float> values) {
    for (float& value : values) value = inHalfPrecision(value);
}

}  // namespace nerfvdb
