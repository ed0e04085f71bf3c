// SPDX-License-Identifier: Apache-2.0
// What each knob of rendering costs and brings: time of a frame against error from the finest setting.
#pragma once

#include "bench/plot.h"
#include "bench/result.h"
#include "bench/scene.h"

namespace nerfvdb {

struct SweepOptions {
    int repeats = 5;
};

/// A series per knob (step length, weight threshold, stop transmittance, occupancy threshold, resolution), all
/// others at their defaults; each series holds the default too. Columns: the knob's value; seconds and
/// cpu_seconds of a frame; psnr_finest against pictures with a step of 1/8 voxel and nothing skipped;
/// psnr_photos against the held-out photographs; samples a ray whose density, and whose features, were read.
///
/// Smaller pictures are judged at full size, enlarged by linear interpolation. Settings are timed in turn
/// (repeat.h). Needs held-out views in the subject.
BenchResult benchRender(const Subject& subject, const SweepOptions& options, Report& report);

Plot renderPlot(const BenchResult& result);

/// Enlarges a picture by linear interpolation between pixel centres; edges are continued.
Image enlarged(const Image& picture, int width, int height);

}  // namespace nerfvdb
