// SPDX-License-Identifier: Apache-2.0
#include "bench/skip.h"

#include <algorithm>
#include <deque>
#include <optional>

#include "bench/number_text.h"
#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "bench/stopwatch.h"
#include "bench/training_probe.h"
#include "bench/unskipped.h"
#include "core/error.h"
#include "core/metrics.h"
#include "trainer/evaluate.h"
#include "trainer/trainer.h"
#include "vdb/renderer.h"

namespace nerfvdb {
namespace {

constexpr const char* kLeaves = "empty leaves";
constexpr const char* kVoxels = "empty voxels";
constexpr const char* kSpace = "empty leaves and voxels";
constexpr const char* kBehind = "behind surfaces";
constexpr const char* kWeights = "negligible weights";
constexpr const char* kRays = "rays that meet nothing";
constexpr const char* kUnseen = "voxels that no view sees";
constexpr const char* kEverything = "all of these";

TraceOptions withoutStop(TraceOptions trace) {
    trace.stop_transmittance = 0;
    return trace;
}

TraceOptions withoutThreshold(TraceOptions trace) {
    trace.min_weight = trace.max_dropped = 0;
    return trace;
}

/// One way to render: what it is called, what it marches through, how.
struct Frame {
    std::string skipped;  // what this one does not skip; empty: it skips everything
    Renderer renderer;
};

struct FrameCost {
    TraceCounters counters;
    double psnr = 0;
};

FrameCost judge(const Renderer& renderer, const std::vector<View>& views, const Vec3f& background) {
    FrameCost cost;
    for (const View& view : views) {
        const RenderedImage picture = renderer.render(view.camera);
        cost.counters += picture.counters;
        cost.psnr += psnr(picture.rgb, photoOver(view.photo, background)) / static_cast<double>(views.size());
    }
    return cost;
}

double perRay(std::uint64_t samples, const TraceCounters& counters) {
    return static_cast<double>(samples) / static_cast<double>(std::max<std::uint64_t>(counters.rays, 1));
}

/// A row from what was measured with everything skipped and without one kind. Times are per `per` calls' worth.
BenchRow rowOf(const std::string& series, const std::string& label, const Timing& with, const Timing& without,
               double scale_with, double scale_without, const TraceCounters& counters_with,
               const TraceCounters& counters_without) {
    BenchRow row{series, label, std::vector<std::vector<double>>(9)};
    for (std::size_t r = 0; r < with.wall_s.size(); ++r) {
        row.cells[0].push_back(with.wall_s[r] * scale_with);
        row.cells[1].push_back(without.wall_s[r] * scale_without);
        row.cells[2].push_back(row.cells[1].back() / row.cells[0].back());
    }
    row.cells[3] = {perRay(counters_with.samples_density, counters_with)};
    row.cells[4] = {perRay(counters_without.samples_density, counters_without)};
    row.cells[5] = {perRay(counters_with.samples_features, counters_with)};
    row.cells[6] = {perRay(counters_without.samples_features, counters_without)};
    return row;
}

void benchFrames(const Subject& subject, const Unskipped& unskipped, const SkipOptions& options, Report& report,
                 BenchResult& result) {
    const std::vector<View>& views = subject.test.views;
    const Model& model = subject.model;
    RenderOptions plain, to_the_end, all_weights, all_rays, everything;
    to_the_end.trace = withoutStop(plain.trace);
    all_weights.trace = withoutThreshold(plain.trace);
    all_rays.trace.skip_unlit = false;
    everything.trace = withoutThreshold(withoutStop(all_rays.trace));

    std::deque<Frame> frames;  // stays in place while it grows: bodies refer to its elements
    frames.push_back({"", Renderer(model, plain)});
    frames.push_back({kLeaves, Renderer(model, plain, unskipped.walkedLeaves())});
    frames.push_back({kVoxels, Renderer(unskipped.full(), plain, unskipped.wholeLeaves())});
    frames.push_back({kBehind, Renderer(model, to_the_end)});
    frames.push_back({kWeights, Renderer(model, all_weights)});
    frames.push_back({kRays, Renderer(model, all_rays)});
    if (const auto dense = unskipped.wholeBox()) {
        frames.push_back({kSpace, Renderer(unskipped.full(), plain, *dense)});
        frames.push_back({kEverything, Renderer(unskipped.full(), everything, *dense)});
    } else {
        result.notes.push_back(
            "no dense march: the box has no corner that is empty enough to stand for the rest");
    }

    std::vector<FrameCost> costs;
    std::vector<std::function<void()>> bodies;
    for (const Frame& frame : frames) {
        if (report.cancelled()) throw Interrupted("stopped before anything was measured, as asked");
        costs.push_back(judge(frame.renderer, views, model.background));
        bodies.push_back([&frame, &views] {
            for (const View& view : views) frame.renderer.render(view.camera);
        });
    }
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .warm_up = false}, "rendering", report);
    const double per_frame = 1 / static_cast<double>(views.size());
    for (std::size_t f = 1; f < frames.size(); ++f) {
        BenchRow row = rowOf("rendering", frames[f].skipped, timings[0], timings[f], per_frame, per_frame,
                             costs[0].counters, costs[f].counters);
        row.cells[7] = {costs[0].psnr};
        row.cells[8] = {costs[f].psnr};
        result.rows.push_back(std::move(row));
    }
}

void benchSteps(const Subject& subject, const Unskipped& unskipped, const SkipOptions& options, Report& report,
                BenchResult& result) {
    struct Step {
        std::string skipped;
        TrainingProbe probe;
        TraceOptions trace;
    };
    std::deque<Step> steps;
    const auto add = [&](const char* skipped, const Model& model, const TraceOptions& trace) -> TrainingProbe& {
        steps.push_back({skipped, TrainingProbe(model, subject.train), trace});
        return steps.back().probe;
    };
    // Sources stay those of the plain step where rays are to be the same.
    const TraceOptions plain;
    add("", subject.model, plain);
    add(kLeaves, subject.model, plain).state().occupancy = unskipped.walkedLeaves();
    TrainingProbe& voxels = add(kVoxels, unskipped.full(), plain);
    voxels.state().occupancy = unskipped.wholeLeaves();
    add(kBehind, subject.model, withoutStop(plain));
    add(kWeights, subject.model, withoutThreshold(plain));
    TrainingProbe& all_rays = add(kRays, subject.model, plain);
    aimAtWholeBox(all_rays.source(), subject.model.field);

    std::vector<TraceCounters> counters;
    std::vector<std::function<void()>> bodies;
    for (Step& step : steps) {
        counters.push_back(step.probe.step(options.batch, step.trace).trace);
        bodies.push_back([&step, &options] { step.probe.step(options.batch, step.trace); });
    }
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .min_sample_s = 0.05, .calls = kSmoothEvery}, "training steps", report);
    const auto useful = [](const TraceCounters& c) {
        return static_cast<double>(std::max<std::uint64_t>(c.rays - c.rays_skipped, 1)) /
               static_cast<double>(c.rays);
    };
    for (std::size_t s = 1; s < steps.size(); ++s) {
        const double as_many_useful =
            steps[s].skipped == kRays ? useful(counters[0]) / useful(counters[s]) : 1.0;
        result.rows.push_back(rowOf("training", steps[s].skipped, timings[0], timings[s], 1, as_many_useful,
                                    counters[0], counters[s]));
    }
}

/// Trainings of one schedule with and without a kind of skipping, and how good their models are.
void benchTrainings(const Subject& subject, const SkipOptions& options, Report& report, BenchResult& result) {
    struct Learned {
        Timing timing;
        Evaluation judged;
        std::size_t voxels = 0;
    };
    const auto learn = [&](const TrainOptions& training) {
        Stopwatch watch;
        watch.start();
        const TrainResult learned = train(subject.train, training, report, {});
        if (learned.interrupted) throw Interrupted("stopped before all was measured, as asked");
        watch.pause();
        return Learned{{{watch.wallSeconds()}, {watch.cpuSeconds()}},
                       evaluate(learned.model, subject.test, {}, report),
                       learned.active_voxels};
    };
    const auto compare = [&](const char* label, const Learned& with, const Learned& without) {
        BenchRow row = rowOf("whole training", label, with.timing, without.timing, 1, 1, with.judged.counters,
                             without.judged.counters);
        row.cells[7] = {with.judged.psnr};
        row.cells[8] = {without.judged.psnr};
        result.rows.push_back(std::move(row));
    };
    TrainOptions all_levels;
    all_levels.steps = {options.train_steps};
    const Learned with = learn(all_levels);
    all_levels.keep_unseen = true;
    const Learned without = learn(all_levels);
    compare(kUnseen, with, without);
    result.figures.emplace_back("active voxels, without those that no view sees", static_cast<double>(with.voxels));
    result.figures.emplace_back("active voxels, with them", static_cast<double>(without.voxels));

    // A dense grid at the finest voxels would not end: the two coarse levels.
    TrainOptions coarse;
    const std::int64_t n = std::max<std::int64_t>(1, options.train_steps / 10);
    coarse.steps = {n, n, 2 * n};
    const Learned sparse = learn(coarse);
    coarse.skip_nothing = true;
    const Learned dense = learn(coarse);
    compare(kEverything, sparse, dense);
    result.figures.emplace_back("active voxels of 128 a side, with skipping", static_cast<double>(sparse.voxels));
    result.figures.emplace_back("active voxels of 128 a side, nothing skipped", static_cast<double>(dense.voxels));
}

}  // namespace

BenchResult benchSkip(const Subject& subject, const SkipOptions& options, Report& report) {
    if (subject.test.views.empty())
        throw DataError(subject.test.root.string(), "no held-out views", "at least one to render");
    BenchResult result;
    result.kind = "skip";
    result.title = "What skipping saves: " + subject.name;
    result.facts = gatherFacts();
    result.columns = {secondsColumn("seconds_with"),
                      {"seconds_without", "s", Better::neither, Noise::timed},
                      {"slowdown", "", Better::neither, Noise::noisy},
                      {"density_with", "", Better::lower, Noise::exact, 0.01, 0},
                      {"density_without", "", Better::neither, Noise::exact},
                      {"features_with", "", Better::lower, Noise::exact, 0.01, 0},
                      {"features_without", "", Better::neither, Noise::exact},
                      decibelColumn("psnr_with"),
                      {"psnr_without", "dB", Better::neither, Noise::exact}};
    const Unskipped unskipped(subject.model);
    benchFrames(subject, unskipped, options, report, result);
    benchSteps(subject, unskipped, options, report, result);
    benchTrainings(subject, options, report, result);
    result.notes.push_back("with: everything skipped, seconds of a frame or of a step of " +
                           std::to_string(options.batch) + " rays; without: all but this kind");
    result.notes.push_back("a whole training: " + std::to_string(options.train_steps) +
                           " steps, timed once; samples and PSNR are those of its model's held-out views");
    result.notes.push_back("a whole training without all of these: a dense grid of at most 128 voxels a side, and the same steps "
                           "with skipping");
    const std::vector<std::string> costly = costlySkips(result);
    result.notes.push_back(costly.empty() ? "no kind of skipping costs more than " + numberText(kMostLost) + " dB"
                                          : "skipping that costs more than " + numberText(kMostLost) + " dB:");
    result.notes.insert(result.notes.end(), costly.begin(), costly.end());
    result.notes.push_back("training steps are done with all rates zero, on the finished model");
    return result;
}

std::vector<std::string> costlySkips(const BenchResult& result) {
    const std::size_t with = result.column("psnr_with"), without = result.column("psnr_without");
    std::vector<std::string> costly;
    for (const BenchRow& row : result.rows) {
        if (row.cells[with].empty() || row.cells[without].empty()) continue;
        const double lost = result.median(row, "psnr_without") - result.median(row, "psnr_with");
        if (!(lost <= kMostLost)) costly.push_back(row.series + ", " + row.label + ": " + numberText(lost) + " dB");
    }
    return costly;
}

Plot skipPlot(const BenchResult& result) {
    Plot plot = plotByLabel(result, "slowdown");
    plot.x.label = "time without this kind of skipping, over time with all kinds";
    plot.x.is_log = true;
    return plot;
}

}  // namespace nerfvdb
