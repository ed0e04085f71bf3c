// SPDX-License-Identifier: Apache-2.0
#include "bench/render_sweep.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "bench/half_precision.h"
#include "bench/number_text.h"
#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "core/error.h"
#include "core/metrics.h"
#include "trainer/evaluate.h"
#include "vdb/adapt.h"
#include "vdb/renderer.h"

namespace nerfvdb {
namespace {

struct Setting {
    std::string knob;
    double value = 0;
    RenderOptions render;
    double scale = 1;  // of width and height
    bool half_precision = false;
};

std::vector<Setting> settings() {
    std::vector<Setting> all;
    for (const double step : {0.25, 0.5, 0.75, 1.0, 1.5, 2.0}) {
        all.push_back({"step, voxels", step, {}});
        all.back().render.trace.step_voxels = static_cast<float>(step);
    }
    // What may be dropped along a ray keeps its proportion to what may be dropped at a sample.
    const TraceOptions defaults;
    for (const double weight : {0.0, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2}) {
        all.push_back({"least weight", weight, {}});
        all.back().render.trace.min_weight = static_cast<float>(weight);
        all.back().render.trace.max_dropped =
            static_cast<float>(weight) * (defaults.max_dropped / defaults.min_weight);
    }
    for (const double transmittance : {0.0, 1e-5, 1e-4, 1e-3, 1e-2, 5e-2}) {
        all.push_back({"stop transmittance", transmittance, {}});
        all.back().render.trace.stop_transmittance = static_cast<float>(transmittance);
    }
    for (const double alpha : {0.0, 1e-3, 1e-2, 5e-2, 0.1, 0.2}) {
        all.push_back({"least alpha of a cell", alpha, {}});
        all.back().render.min_alpha = static_cast<float>(alpha);
    }
    for (const double scale : {1.0, 0.75, 0.5, 0.25}) all.push_back({"resolution", scale, {}, scale});
    for (const double bits : {32.0, 16.0}) all.push_back({"bits of a value", bits, {}, 1, bits == 16});
    return all;
}

RenderOptions finestOptions() {
    RenderOptions options;
    options.trace = {.step_voxels = 0.125f, .stop_transmittance = 0, .min_weight = 0, .max_dropped = 0};
    options.min_alpha = 0;
    return options;
}

/// The same with densities and features of 16 bits; rendering still reads 32, so its time is no other.
Model inHalfPrecision(const Model& model) {
    Model half;
    half.field = copyField(model.field, model.field.topology());
    storeInHalfPrecision(half.field.density());
    storeInHalfPrecision(half.field.features());
    half.decoder = model.decoder;
    half.background = model.background;
    half.sky = model.sky;
    return half;
}

int scaledSize(int size, double scale) { return std::max(1, static_cast<int>(std::lround(size * scale))); }

/// Everything that a setting's frames are made with, ready before the clock starts.
struct Work {
    std::unique_ptr<Renderer> renderer;
    std::vector<Camera> cameras;
};

}  // namespace

Image enlarged(const Image& picture, int width, int height) {
    Image result(width, height, picture.channels);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float u = std::clamp((x + 0.5f) * picture.width / width - 0.5f, 0.0f, picture.width - 1.0f);
            const float v =
                std::clamp((y + 0.5f) * picture.height / height - 0.5f, 0.0f, picture.height - 1.0f);
            const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
            const int x1 = std::min(x0 + 1, picture.width - 1), y1 = std::min(y0 + 1, picture.height - 1);
            const float fx = u - static_cast<float>(x0), fy = v - static_cast<float>(y0);
            for (int c = 0; c < picture.channels; ++c)
                result.at(x, y)[c] =
                    (1 - fy) * ((1 - fx) * picture.at(x0, y0)[c] + fx * picture.at(x1, y0)[c]) +
                    fy * ((1 - fx) * picture.at(x0, y1)[c] + fx * picture.at(x1, y1)[c]);
        }
    return result;
}

BenchResult benchRender(const Subject& subject, const SweepOptions& options, Report& report) {
    const std::vector<View>& views = subject.test.views;
    if (views.empty())
        throw DataError(subject.test.root.string(), "no held-out views", "at least one to render");
    const double n_views = static_cast<double>(views.size());

    std::vector<Image> finest, photos;
    const Renderer finest_renderer(subject.model, finestOptions());
    report.begin("finest", static_cast<std::int64_t>(views.size()));
    for (const View& view : views) {
        if (report.cancelled()) throw Interrupted("stopped before anything was measured, as asked");
        finest.push_back(finest_renderer.render(view.camera).rgb);
        photos.push_back(photoOver(view.photo, subject.model.background));
        report.update(static_cast<std::int64_t>(finest.size()), "");
    }
    report.end();

    BenchResult result;
    result.kind = "render";
    const Camera& camera = views.front().camera;
    result.title = "Rendering " + subject.name + " at " + std::to_string(camera.width) + "x" +
                   std::to_string(camera.height) + ": error against time";
    result.facts = gatherFacts();
    result.columns = {{"value"},
                      secondsColumn("seconds"),
                      secondsColumn("cpu_seconds"),
                      decibelColumn("psnr_finest"),
                      decibelColumn("psnr_photos"),
                      {"density_samples", "", Better::lower, Noise::exact, 0.01, 0},
                      {"feature_samples", "", Better::lower, Noise::exact, 0.01, 0}};

    const std::vector<Setting> all = settings();
    const Model half = inHalfPrecision(subject.model);
    std::vector<Work> works;
    std::vector<std::function<void()>> bodies;
    for (const Setting& setting : all) {
        Work work{std::make_unique<Renderer>(setting.half_precision ? half : subject.model, setting.render), {}};
        double psnr_finest = 0, psnr_photos = 0;
        TraceCounters counters;
        for (std::size_t v = 0; v < views.size(); ++v) {
            const Camera& full = views[v].camera;
            work.cameras.push_back(setting.scale == 1 ? full
                                                      : resized(full, scaledSize(full.width, setting.scale),
                                                                scaledSize(full.height, setting.scale)));
            const RenderedImage picture = work.renderer->render(work.cameras.back());
            const Image at_full_size =
                setting.scale == 1 ? picture.rgb : enlarged(picture.rgb, full.width, full.height);
            psnr_finest += psnr(at_full_size, finest[v]) / n_views;
            psnr_photos += psnr(at_full_size, photos[v]) / n_views;
            counters += picture.counters;
        }
        const double rays = static_cast<double>(std::max<std::uint64_t>(counters.rays, 1));
        result.rows.push_back({setting.knob,
                               numberText(setting.value),
                               {{setting.value},
                                {},
                                {},
                                {psnr_finest},
                                {psnr_photos},
                                {static_cast<double>(counters.samples_density) / rays},
                                {static_cast<double>(counters.samples_features) / rays}}});
        works.push_back(std::move(work));
    }
    for (const Work& work : works)
        bodies.push_back([&work] {
            for (const Camera& view : work.cameras) work.renderer->render(view);
        });

    // The pictures above were the warm-up.
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .warm_up = false}, "rendering", report);
    for (std::size_t s = 0; s < timings.size(); ++s) {
        for (const double seconds : timings[s].wall_s) result.rows[s].cells[1].push_back(seconds / n_views);
        for (const double seconds : timings[s].cpu_s) result.rows[s].cells[2].push_back(seconds / n_views);
    }
    result.notes.push_back("finest: a step of 1/8 voxel, nothing skipped; " + std::to_string(views.size()) +
                           " views; each knob alone, the others at their defaults");
    return result;
}

Plot renderPlot(const BenchResult& result) {
    Plot plot = plotColumns(result, "seconds", "psnr_finest");
    plot.x.label = "seconds a frame";
    plot.y.label = "PSNR against the finest setting, dB";
    plot.x.is_log = true;
    markFront(plot);
    return plot;
}

}  // namespace nerfvdb
