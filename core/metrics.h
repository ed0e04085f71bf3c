// SPDX-License-Identifier: Apache-2.0
// How good a picture is. Both metrics take sRGB values in [0, 1], images of the same size with 3 channels.
#pragma once

#include "core/image.h"

namespace nerfvdb {

/// Mean squared error over all pixels and channels.
double meanSquaredError(const Image& a, const Image& b);

/// -10 log10(mse), in dB; identical images give 100 (instead of infinity), so that means stay finite.
double psnrFromMse(double mse);
double psnr(const Image& a, const Image& b);

/// Mean structural similarity: Wang et al. 2004, "Image quality assessment", eq. 13, with the standard
/// 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, L = 1, windows that lie fully inside the image,
/// averaged over pixels and channels. Images smaller than 11x11 throw UsageError.
double ssim(const Image& a, const Image& b);

}  // namespace nerfvdb
