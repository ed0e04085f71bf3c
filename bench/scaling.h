// SPDX-License-Identifier: Apache-2.0
// What more threads, more rays at once and more pixels bring: rays a second of training and of rendering.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "bench/plot.h"
#include "bench/result.h"
#include "bench/scene.h"

namespace nerfvdb {

struct ScalingOptions {
    int repeats = 5;
    std::vector<int> batches = {512, 1024, 4096, 8192};  // rays a training step, as the stages use them
    std::vector<double> scales = {1.0, 0.5};             // of the rendered pictures' edges
};

/// A series for each batch of training ("training, 4096 rays") and each size of picture ("rendering, 400x400"),
/// a row for each number of threads up to those allowed. Columns: threads, seconds of a step or frame,
/// cpu_seconds, rays a second, speedup over one thread; and what it costs that models do not depend on the number of
/// threads (gradient_order.h). Figures: for each series the serial share by Amdahl's
/// law and the speed-up on 16 threads that follows from it, and for training the share of useful rays.
BenchResult benchScaling(const Subject& subject, const ScalingOptions& options, Report& report);

/// Speed-up against threads, with what Amdahl's law predicts from the measured share up to 16 threads.
Plot scalingPlot(const BenchResult& result);

/// The serial share s that fits T(n) / T(1) = s + (1 - s) / n best (least squares over n > 1), in [0, 1].
/// Source: Amdahl 1967, "Validity of the single processor approach". Pairs are (threads, seconds) and must hold
/// one thread; with nothing else there is nothing to fit, and the result is 0.
double serialShare(std::span<const std::pair<int, double>> threads_seconds);

/// Speed-up on n threads at serial share s.
double amdahlSpeedup(double serial_share, int threads);

}  // namespace nerfvdb
