// SPDX-License-Identifier: Apache-2.0
// The decoder, forward and backward, against itself in long double.
#pragma once

#include <vector>

#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

/// Rows of area "decoder": colours, and gradients of features, of the light that is left and of the network,
/// each relative to the sum of the magnitudes of its terms; on the instruction set in use.
std::vector<StressRow> stressDecoder(Report& report);

}  // namespace nerfvdb
