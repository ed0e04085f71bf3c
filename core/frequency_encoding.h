// SPDX-License-Identifier: Apache-2.0
// Sines and cosines of growing frequency, so that a small network can follow fine detail of a coordinate.
// Source: Mildenhall et al. 2020, eq. 4 (whose order this keeps: sine and cosine of each frequency in turn).
#pragma once

#include <cmath>

namespace nerfvdb {

/// out[2 k] = sin(2^k pi x), out[2 k + 1] = cos(2^k pi x) for k < n_frequencies; x is in [-1, 1].
/// Double inside: 2^k pi x in single precision would lose a digit for every three frequencies.
inline void frequencyEncoding(float x, int n_frequencies, float* out) {
    double angle = 3.14159265358979323846 * static_cast<double>(x);
    for (int k = 0; k < n_frequencies; ++k, angle *= 2) {
        out[2 * k] = static_cast<float>(std::sin(angle));
        out[2 * k + 1] = static_cast<float>(std::cos(angle));
    }
}

/// dl_dx from the encoding itself and dl_dout [2 n_frequencies]: d sin = cos, d cos = -sin, times 2^k pi.
inline float frequencyEncodingBackward(int n_frequencies, const float* out, const float* dl_dout) {
    double dl_dx = 0, scale = 3.14159265358979323846;
    for (int k = 0; k < n_frequencies; ++k, scale *= 2)
        dl_dx += scale * (static_cast<double>(dl_dout[2 * k]) * out[2 * k + 1] -
                          static_cast<double>(dl_dout[2 * k + 1]) * out[2 * k]);
    return static_cast<float>(dl_dx);
}

}  // namespace nerfvdb
