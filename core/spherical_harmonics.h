// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics: a smooth basis for what depends on a direction.
#pragma once

namespace nerfvdb {

inline constexpr int kSphericalHarmonics = 16;  // degrees 0 to 3

/// Y[l^2 + l + m](x, y, z), l < 4, for a unit direction; orthonormal over the sphere.
/// Source: Sloan 2013, "Efficient spherical harmonic evaluation", appendix A2 (with his signs).
inline void sphericalHarmonics(float x, float y, float z, float* out, int stride = 1) {
    const float xx = x * x, yy = y * y, zz = z * z;
    out[0 * stride] = 0.28209479177387814f;
    out[1 * stride] = -0.48860251190291987f * y;
    out[2 * stride] = 0.48860251190291987f * z;
    out[3 * stride] = -0.48860251190291987f * x;
    out[4 * stride] = 1.0925484305920792f * x * y;
    out[5 * stride] = -1.0925484305920792f * y * z;
    out[6 * stride] = 0.94617469575755997f * zz - 0.31539156525251999f;
    out[7 * stride] = -1.0925484305920792f * x * z;
    out[8 * stride] = 0.54627421529603959f * (xx - yy);
    out[9 * stride] = 0.59004358992664352f * y * (yy - 3 * xx);
    out[10 * stride] = 2.8906114426405538f * x * y * z;
    out[11 * stride] = 0.45704579946446572f * y * (1 - 5 * zz);
    out[12 * stride] = 0.3731763325901154f * z * (5 * zz - 3);
    out[13 * stride] = 0.45704579946446572f * x * (1 - 5 * zz);
    out[14 * stride] = 1.4453057213202769f * z * (xx - yy);
    out[15 * stride] = 0.59004358992664352f * x * (3 * yy - xx);
}

}  // namespace nerfvdb
