// SPDX-License-Identifier: Apache-2.0
// All benchmarks one after the other, on one scene learned on the way.
#pragma once

#include <filesystem>
#include <functional>

#include "bench/result.h"
#include "core/report.h"

namespace nerfvdb {

enum class SuiteSize {
    quick,  // at most five minutes on two cores: does everything work, has anything become far slower
    full,   // half an hour and more: figures to keep
};

struct SuiteOptions {
    SuiteSize size = SuiteSize::full;
    std::filesystem::path folder = {};             // results and plots go there
    std::vector<std::filesystem::path> data = {};  // scenes on disk; none: procedural ones
    int repeats = 0;                               // 0: as the size has it
};

/// Runs quality, then learns the first scene and runs render, scaling and skip on it, then kernels and mesh; each is
/// written to the folder (result_plot.h) as soon as it is there. on_result gets each result. Throws what they
/// throw.
void runSuite(const SuiteOptions& options, Report& report,
              const std::function<void(const BenchResult&)>& on_result);

}  // namespace nerfvdb
