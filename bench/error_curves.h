// SPDX-License-Identifier: Apache-2.0
// Error of a ray's colour against what the ray costs, one knob at a time: the curves that the defaults are chosen from.
#pragma once

#include "bench/plot.h"
#include "bench/result.h"
#include "core/report.h"

namespace nerfvdb {

struct ErrorCurveOptions {
    int rays = 400;  // of each point of a curve
    int repeats = 5;
    double min_sample_s = 0.01;  // of a repeat
};

/// Kind "stress-error": one series per knob and scene (a ball with a hard surface; fog). Columns: the knob's value,
/// microseconds a ray on one thread, samples read per ray, largest and mean error of colour in levels, and the bound in
/// levels where there is one. Errors are from the full sum at the same step; of "step" from a step of 1/64 voxel. Figures:
/// the order of convergence in the step, each halving's.
BenchResult errorCurves(const ErrorCurveOptions& options, Report& report);
Plot errorCurvePlot(const BenchResult& result);

}  // namespace nerfvdb
