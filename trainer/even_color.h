// SPDX-License-Identifier: Apache-2.0
// What a picture of one colour would be worth: a model that shows its own photographs no better has learned nothing.
#pragma once

#include <cstdint>

#include "core/types.h"
#include "trainer/ray_source.h"

namespace nerfvdb {

/// Mean squared error a channel of the best single colour for the pixels that rays of step `step` are drawn from, laid on
/// `background` where they have alpha. Of 4096 rays: good to a few percent. The source must have a tile.
double evenColorError(const RaySource& source, std::uint64_t step, const Vec3f& background);

}  // namespace nerfvdb
