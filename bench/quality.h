// SPDX-License-Identifier: Apache-2.0
// How good a scene looks after how long: PSNR and SSIM of held-out views against seconds.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "bench/plot.h"
#include "bench/result.h"
#include "bench/scene.h"
#include "trainer/trainer.h"

namespace nerfvdb {

struct QualityOptions {
    std::vector<double> times_s = {};  // a separate run for each, from loading the data to the model on disk
    std::vector<Preset> presets = {};  // for each one run, looked at on its way
    std::int64_t preset_steps = 0;     // instead of the preset's own number of steps; 0: its own
    int seeds = 1;                     // repeats with seed 1, 2, ...
    int views = 0;                     // score at most so many of the held-out views; 0: all
    double first_look_s = 5;  // a preset's run is looked at then, and each time twice as much has passed
    std::filesystem::path scratch = ".";  // folder for models and checkpoints, removed afterwards
};

/// Series "SCENE" has a row for each of times_s; series "SCENE, PRESET" one for each look. Columns: seconds and
/// cpu_seconds of training, psnr and ssim of held-out views, steps, rays, active voxels, bytes of the model's
/// file.
///
/// A separate run does what `nerfvdb train --time` does, in this process: load, train, save; its clock stops
/// while it is scored. A look interrupts training, scores the model so far, and resumes; the learning rates of
/// such a model are still high, so it scores a little lower than a run that was planned to end there.
BenchResult benchQuality(std::span<const BenchScene> scenes, const QualityOptions& options, Report& report);

Plot qualityPlot(const BenchResult& result);

}  // namespace nerfvdb
