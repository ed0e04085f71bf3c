// SPDX-License-Identifier: Apache-2.0
// --debug-ray IMAGE:X:Y[:JITTER]: one pixel's ray, sample by sample.
#pragma once

#include <string>

#include "cli/json_output.h"
#include "trainer/dataset.h"
#include "vdb/ray_replay.h"

namespace nerfvdb {

/// A pixel of a data set's view; `image` is the view's number, or the end of its file's path.
struct DebugPixel {
    std::size_t view = 0;
    int x = 0, y = 0;
    float jitter = 0.5f;  // of its samples along the ray, in steps: [0, 1)
};

/// Throws UsageError for what is not IMAGE:X:Y or IMAGE:X:Y:JITTER, or not a pixel of the data set.
DebugPixel parseDebugPixel(const std::string& text, const Dataset& dataset);

/// The ray through the pixel's centre, replayed.
ReplayedRay replayPixel(const Model& model, const Dataset& dataset, const DebugPixel& pixel);

std::string replayText(const ReplayedRay& ray);
Json replayJson(const ReplayedRay& ray);

}  // namespace nerfvdb
