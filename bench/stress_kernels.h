// SPDX-License-Identifier: Apache-2.0
// Every instruction set that this machine runs, forced in turn, against the scalar reference; and with finite
// input of any size, whether anything leaves that is not finite.
#pragma once

#include <vector>

#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

/// Rows of one area per instruction set: each kernel's largest difference from the reference relative to the
/// sum of the magnitudes of its terms, and values that are not finite. The best set is active again afterwards.
/// Not while kernels run elsewhere.
std::vector<StressRow> stressKernels(Report& report);

}  // namespace nerfvdb
