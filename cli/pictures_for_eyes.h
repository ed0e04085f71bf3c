// SPDX-License-Identifier: Apache-2.0
// What a render holds in numbers, as pictures that one can look at.
#pragma once

#include <span>

#include "core/image.h"

namespace nerfvdb {

/// Distances in grey: near is white, far is dark, nothing (0) is black; by the logarithm, or all of a place would be
/// white but its horizon. 1 channel to 1.
Image depthForEyes(const Image& depth);

/// The usual colours of normals: x, y, z in [-1, 1] as red, green, blue in [0, 1].
Image normalsForEyes(const Image& normal);

/// Pictures of one height, of 1 or 3 channels, from left to right in one of 3. Throws UsageError for others.
Image sideBySide(std::span<const Image> pictures);

}  // namespace nerfvdb
