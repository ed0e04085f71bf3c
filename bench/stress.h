// SPDX-License-Identifier: Apache-2.0
// The suite of numerical promises: short, as `nerfvdb selftest` runs it, and long, as `nerfvdb bench stress`
// does.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/result.h"
#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

struct StressOptions {
    bool is_long = false;  // every combination, every instruction set, longer trainings, many seeds
    int seeds = 20;        // of each procedural scene; only if long, 0: none
    std::filesystem::path scratch = {};  // images and models stay there briefly; empty: the system's temporary folder
};

struct StressResult {
    std::vector<StressRow> rows;
    RunFacts facts;
    double seconds = 0;
};

/// Runs everything. Best set of instructions active again afterwards; not while anything else uses the kernels.
/// Throws Interrupted when the report asks to stop.
StressResult runStress(const StressOptions& options, Report& report);

/// Tables of the rows and of the error curves, with the facts of the run: the second half of docs/stability.md.
std::string stressDocument(const StressResult& result, const BenchResult& curves);

}  // namespace nerfvdb
