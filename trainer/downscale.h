// SPDX-License-Identifier: Apache-2.0
// A view of fewer pixels: blocks of n x n become one. Pixels at the right and the bottom that fill no block are left
// out, so that the intrinsics are scaled by exactly n and no pixel is a mixture with other weights.
#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "core/pixel_mask.h"

namespace nerfvdb {

/// The camera of a photograph that downscaled(photo, n) returns. n >= 1.
Camera downscaled(const Camera& camera, int n);

/// Mean light of each block, as a sensor of larger pixels would have gathered it: linear, weighted by alpha.
/// n >= 1 and no larger than the photograph's sides.
Photo downscaled(const Photo& photo, int n);

/// A block counts if all of its pixels do.
PixelMask downscaled(const PixelMask& mask, int n);

}  // namespace nerfvdb
