// SPDX-License-Identifier: Apache-2.0
// A name for what a data set shows, so that training is never resumed on another one.
#pragma once

#include <string>

#include "trainer/dataset.h"

namespace nerfvdb {

/// Hash of the views in their order: cameras bit by bit, every pixel of the photographs and masks; 32 hexadecimal digits.
/// File names do not count: a data set may move. Cost: one pass over the pixels, at the speed of memory.
std::string datasetHash(const Dataset& dataset);

}  // namespace nerfvdb
