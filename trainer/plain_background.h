// SPDX-License-Identifier: Apache-2.0
// Photographs of an object before nothing: rendered on white, or cut out and laid on black.
#pragma once

#include <optional>

#include "core/types.h"
#include "trainer/dataset.h"

namespace nerfvdb {

/// How far a channel of a plain background may be off its colour, of 1: what compressing a photograph does to it, 4 of 255 and
/// what float makes of them.
inline constexpr float kPlainTolerance = 4.5f / 255;

/// The one colour (sRGB) that nearly all pixels along the borders of nearly all photographs have, and most of those a tenth of
/// a picture further in; empty where there is none, as in photographs of places, or of paper, which lamps shade, and for
/// fisheyes, whose pictures may be round.
std::optional<Vec3f> plainBackground(const Dataset& dataset);

}  // namespace nerfvdb
