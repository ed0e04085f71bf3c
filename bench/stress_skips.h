// SPDX-License-Identifier: Apache-2.0
// What skipping costs: the proved bound on the error of the thresholds along a whole ray (docs/stability.md,
// "What skipping may cost"), held against scenes made to break it.
#pragma once

#include <vector>

#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

struct SkipStressOptions {
    int scenes = 200;  // random ones; the adversarial ones come on top
};

/// Rows of area "skipping", in levels of 8 bits: early stop, dropped weights and passed-by cells, alone and
/// together, against the full sum in long double; of linear colours, and of colours that a network decodes.
std::vector<StressRow> stressSkips(const SkipStressOptions& options, Report& report);

}  // namespace nerfvdb
