// SPDX-License-Identifier: Apache-2.0
// What skipping costs: the proved bound on the error of the thresholds along a whole ray (docs/stability.md,
// "What skipping may cost"), held against scenes made to break it; and curves of error against counted work,
// from which the defaults are chosen.
#pragma once

#include <vector>

#include "bench/plot.h"
#include "bench/result.h"
#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

struct SkipStressOptions {
    int scenes = 200;  // random ones; the adversarial ones come on top
    int rays = 400;    // of each point of a curve
};

/// Rows of area "skipping", in levels of 8 bits: early stop, dropped weights and passed-by cells, alone and
/// together, against the full sum in long double; of linear colours, and of colours that a network decodes.
std::vector<StressRow> stressSkips(const SkipStressOptions& options, Report& report);

/// Kind "stress-error": one series per knob and scene (a ball with a hard surface; fog). Columns: the knob's
/// value, samples read per ray, largest and mean error of colour in levels, and the bound in levels where there
/// is one. Errors are from the full sum at the same step; of "step" from a step of 1/64 voxel. Figures: the
/// order of convergence in the step, each halving's and the last.
BenchResult errorCurves(const SkipStressOptions& options, Report& report);
Plot errorCurvePlot(const BenchResult& result);

}  // namespace nerfvdb
