// SPDX-License-Identifier: Apache-2.0
// One picture out of those that several blocks make of the same view.
#pragma once

#include <span>

#include "vdb/picture.h"

namespace nerfvdb {

/// The mean of pictures of one size by weights that sum to 1 (BlockGrid::weight): colour and opacity by weight alone, depth
/// and normals by weight times opacity, since what is not there is nowhere. Counters are sums: what the picture cost.
/// Throws UsageError for no pictures, other numbers of weights, or pictures of different sizes.
RenderedImage blendPictures(std::span<const RenderedImage> pictures, std::span<const double> weights);

}  // namespace nerfvdb
