// SPDX-License-Identifier: Apache-2.0
// Which photograph shows most nearly what another does, judged by cameras alone.
#pragma once

#include <vector>

#include "trainer/dataset.h"

namespace nerfvdb {

/// For each view the other one whose camera stands and looks most alike: to turn by 6 degrees counts as much as to go as far as
/// it is, for the median of the views, to the nearest camera that stands elsewhere. The first of several; of a single view the
/// view itself. [view]
std::vector<int> nearestViews(const std::vector<View>& views);

}  // namespace nerfvdb
