// SPDX-License-Identifier: Apache-2.0
// How good a picture is. Both metrics take sRGB values in [0, 1], images of the same size with 3 channels.
#pragma once

#include "core/image.h"
#include "core/pixel_mask.h"

namespace nerfvdb {

/// Mean squared error over all pixels that count, and channels. A mask must have the images' size.
double meanSquaredError(const Image& a, const Image& b, const PixelMask& mask = {});

/// -10 log10(mse), in dB; identical images give 100 (instead of infinity), so that means stay finite.
double psnrFromMse(double mse);
double psnr(const Image& a, const Image& b, const PixelMask& mask = {});

/// Mean structural similarity: Wang et al. 2004, "Image quality assessment", eq. 13, with the standard
/// 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, L = 1, windows that lie fully inside the image,
/// averaged over pixels and channels; with a mask, windows in which every pixel counts. Throws UsageError where there is
/// no such window: images smaller than 11x11, or a mask that leaves less.
double ssim(const Image& a, const Image& b, const PixelMask& mask = {});

}  // namespace nerfvdb
