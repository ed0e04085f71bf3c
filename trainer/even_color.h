// SPDX-License-Identifier: Apache-2.0
// What a picture of one colour would be worth: a model that shows its own photographs no better has learned nothing.
#pragma once

#include <cstdint>
#include <string>

#include "core/types.h"
#include "trainer/ray_source.h"

namespace nerfvdb {

/// Mean squared error a channel of the best single colour for the pixels that rays of step `step` are drawn from, laid on
/// `background` where they have alpha. Of 4096 rays: good to a few percent. The source must have a tile.
double evenColorError(const RaySource& source, std::uint64_t step, const Vec3f& background);

/// A sentence about a training of so many steps that left a mean squared error a channel no smaller than that; else nothing. Wrong
/// bounds or poses leave a model that no number calls wrong. The error may also be of rays before random colours, where there is
/// alpha, which only makes it larger.
std::string nothingLearned(const RaySource& source, std::int64_t steps, const Vec3f& background, double mean_error);

}  // namespace nerfvdb
