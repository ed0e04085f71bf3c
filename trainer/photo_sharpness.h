// SPDX-License-Identifier: Apache-2.0
// How fine photographs are, which is not how many pixels they have: lenses, shake and enlargement blur them.
#pragma once

#include "trainer/dataset.h"

namespace nerfvdb {

/// How many pixels wide the finest things are that photographs show: 1, 2, 4 or 8; the median of some of them. Where a
/// photograph is smooth, differences between its pixels grow as their distance does; where it resolves things they grow less.
/// So it is the least distance at which the root of the mean squared difference is more than 0.65 of that at twice the
/// distance (0.5: smooth; 1: noise). 1 for photographs of one colour.
double resolvedPixels(const Dataset& dataset);

}  // namespace nerfvdb
