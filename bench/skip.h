// SPDX-License-Identifier: Apache-2.0
// What each kind of skipping saves and what it costs: rendering and training with all of them, and without
// each.
#pragma once

#include <string>
#include <vector>

#include "bench/plot.h"
#include "bench/result.h"
#include "bench/scene.h"

namespace nerfvdb {

struct SkipOptions {
    int repeats = 5;
    int batch = 4096;      // rays a training step
    int train_steps = 2500;  // of a whole training
};

/// Series "rendering", "training" (one step) and "whole training", a row for each kind that has a switch: what is
/// skipped in the label. Columns: seconds of a frame, step or training with everything skipped (repeated in each
/// row), and without this kind; samples a ray whose density and whose features were read, both ways; psnr of held-out
/// views, both ways (not of steps). Samples of whole trainings are those of the held-out views.
///
/// The switches: empty leaves are no longer jumped: every leaf of the box that holds nothing is walked, as one
/// empty leaf that stands for all of them (a dense grid would also pay for its memory). Empty voxels: every
/// cell of an occupied leaf is looked at. Behind surfaces: rays go on to the end of the box. Negligible
/// weights: features are read for every sample. Rays that meet nothing (training): rays come from all pixels that
/// show the scene's box, and seconds are those of as many useful rays. Voxels that no view sees:
/// TrainOptions::keep_unseen. All of these: in rendering all switches at once, in a whole training
/// TrainOptions::skip_nothing.
BenchResult benchSkip(const Subject& subject, const SkipOptions& options, Report& report);

inline constexpr double kMostLost = 0.05;  // dB that skipping may cost

/// The rows whose PSNR with skipping is lower than without by more than kMostLost: "rendering, behind surfaces: 0.07 dB".
std::vector<std::string> costlySkips(const BenchResult& result);

/// Time without each kind over time with all of them.
Plot skipPlot(const BenchResult& result);

}  // namespace nerfvdb
