// SPDX-License-Identifier: Apache-2.0
// Training on the rack: input that nobody wants to learn from, the same training on other numbers of threads,
// and many seeds.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

/// Steps of a training on hard input after which what it learned is held against a figure.
inline constexpr std::int64_t kEnoughSteps = 400;

/// Rows of area "training": the same bytes on repeated runs and on 1, 2 and 4 threads; learning rates ten times
/// too high.
std::vector<StressRow> stressDeterminism(Report& report);

/// Rows of area "hard input": pictures and cameras from which little or nothing can be learned; each converges,
/// to a finite model, or stops with one of the house's errors. The row's reason tells which, and how. And of
/// area "bad input": values that are not finite, each named where they enter. `scratch`: a folder for images;
/// `steps` of each training.
std::vector<StressRow> stressInput(const std::filesystem::path& scratch, std::int64_t steps, Report& report);

struct SeedStressOptions {
    std::vector<std::string> scenes = {"sphere", "shell", "thin", "glossy", "fog", "demo"};
    int seeds = 20;
    std::int64_t steps = 5500;  // a fifth of the default preset's
    int views = 40, size = 100;  // photographs, as many held out, and pixels along their edge
};

/// A row of area "seeds" per procedural scene: how far a seed's PSNR of held-out views ends from the median of
/// all.
std::vector<StressRow> stressSeeds(const SeedStressOptions& options, Report& report);

}  // namespace nerfvdb
