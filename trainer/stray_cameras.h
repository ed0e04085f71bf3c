// SPDX-License-Identifier: Apache-2.0
// A camera far from all others makes the scene as large as its distance: mostly a pose that is wrong.
#pragma once

#include "trainer/dataset.h"

namespace nerfvdb {

/// Adds a warning to the data set where a few cameras (one in ten at most) stand a hundred times as far from the middle as most.
void warnOfStrayCameras(Dataset& dataset);

}  // namespace nerfvdb
