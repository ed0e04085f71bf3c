// SPDX-License-Identifier: Apache-2.0
// How close a model's pictures come to photographs that it has not seen.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/report.h"
#include "trainer/dataset.h"
#include "vdb/renderer.h"

namespace nerfvdb {

struct EvaluateOptions {
    RenderOptions render;
    int every = 1;  // score views 0, every, 2 * every, ... of the data set
};

struct ViewScore {
    std::size_t index = 0;      // of the view in its data set
    double psnr = 0, ssim = 0;  // metrics.h
    double masked_share = 0;    // of the pixels, not compared
    double seconds = 0;         // wall time of rendering alone
    TraceCounters counters;
};

/// Means are over views, so that each view counts the same whatever its size (the protocol of published
/// tables).
struct Evaluation {
    std::vector<ViewScore> views;
    double psnr = 0, ssim = 0, masked_share = 0, seconds_per_frame = 0;
    TraceCounters counters;  // sums
};

/// A photograph as it is scored: sRGB values, straight alpha composited on `background` in sRGB. 3 channels.
Image photoOver(const Photo& photo, const Vec3f& background);

/// Makes the picture of a view.
using RenderView = std::function<RenderedImage(const Camera& camera)>;

/// Gets a view's score, its picture and its photograph (photoOver).
using OnView = std::function<void(const ViewScore& score, const RenderedImage& picture, const Image& truth)>;

/// Renders and scores views at the full size of their photographs, which must be loaded, and hands each to `on_view`, in
/// order. Pixels that a view's mask leaves out are not compared.
/// Throws UsageError (`every` not positive), DataError (no views; a photograph whose size is not its camera's),
/// Interrupted when the report is cancelled.
Evaluation evaluate(const RenderView& render, const Vec3f& background, const Dataset& dataset, int every_nth,
                    Report& report, const OnView& on_view = {});
/// The same of a model.
Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options, Report& report,
                    const OnView& on_view = {});

}  // namespace nerfvdb
