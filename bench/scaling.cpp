// SPDX-License-Identifier: Apache-2.0
#include "bench/scaling.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "bench/gradient_order.h"
#include "bench/repeat.h"
#include "bench/result_plot.h"
#include "bench/training_probe.h"
#include "core/error.h"
#include "core/parallel.h"
#include "vdb/renderer.h"

namespace nerfvdb {
namespace {

constexpr int kPredicted = 16;  // threads
constexpr const char* kShare = "serial share, ";
constexpr const char* kPrediction = "speed-up on 16 threads, ";

/// 1, 2, 4, ... and the last.
std::vector<int> threadCounts(int most) {
    std::vector<int> counts;
    for (int n = 1; n < most; n *= 2) counts.push_back(n);
    counts.push_back(most);
    return counts;
}

constexpr const char* kOrder = "gradients to voxels, ";

/// Training's way to sum gradients beside the quickest that does not care about order, one thread; and what the
/// difference is of a step of as many rays.
void addGradientOrder(const Subject& subject, const ScalingOptions& options, Report& report, BenchResult& result) {
    const int batch = options.batches.back();
    const std::string rays = std::to_string(batch) + " rays";
    const GradientOrder order = timeGradientOrder(subject.model, subject.train, batch, options.repeats, report);
    const auto add = [&](const std::string& label, const Timing& timing) {
        BenchRow row{kOrder + rays, label, {{1}, timing.wall_s, timing.cpu_s, {}, {}}};
        for (const double seconds : timing.wall_s) row.cells[3].push_back(batch / seconds);
        result.rows.push_back(std::move(row));
    };
    add("by leaf, in the order of rays", order.by_leaf);
    add("as they come", order.as_they_come);
    for (const BenchRow& row : result.rows) {
        if (row.series != "training, " + rays || row.label != "1 thread") continue;
        const double cost = summarize(order.by_leaf.wall_s).median - summarize(order.as_they_come.wall_s).median;
        result.figures.emplace_back("what the order of gradients costs, share of a step of " + rays,
                                    cost / result.median(row, "seconds"));
    }
}

/// Work of one series, the same whatever the number of threads.
struct Work {
    std::string series;
    double rays = 0;
    std::function<void()> run;
};

}  // namespace

double serialShare(std::span<const std::pair<int, double>> threads_seconds) {
    double one = 0;
    for (const auto& [threads, seconds] : threads_seconds)
        if (threads == 1) one = seconds;
    if (!(one > 0)) throw UsageError("serial share", "no time of one thread", "one");
    // T(n) / T(1) - 1/n = s (1 - 1/n): a line through the origin.
    double products = 0, squares = 0;
    for (const auto& [threads, seconds] : threads_seconds) {
        const double share = 1.0 / threads;
        products += (seconds / one - share) * (1 - share);
        squares += (1 - share) * (1 - share);
    }
    return squares > 0 ? std::clamp(products / squares, 0.0, 1.0) : 0.0;
}

double amdahlSpeedup(double serial_share, int threads) {
    return 1 / (serial_share + (1 - serial_share) / threads);
}

BenchResult benchScaling(const Subject& subject, const ScalingOptions& options, Report& report) {
    if (subject.test.views.empty())
        throw DataError(subject.test.root.string(), "no held-out views", "at least one to render");
    BenchResult result;
    result.kind = "scaling";
    result.title = "Scaling: " + subject.name;
    result.facts = gatherFacts();
    result.columns = {{"threads"},
                      secondsColumn("seconds"),
                      secondsColumn("cpu_seconds"),
                      {"rays_per_s", "1/s", Better::higher, Noise::timed, 0.03, 0},
                      {"speedup", "", Better::higher, Noise::noisy, 0.03, 0}};

    TrainingProbe probe(subject.model, subject.train);
    const StepReport first_step = probe.step(options.batches.back());
    std::vector<Work> works;
    for (const int batch : options.batches)
        works.push_back({"training, " + std::to_string(batch) + " rays", static_cast<double>(batch),
                         [&probe, batch] { probe.step(batch); }});
    const Renderer renderer(subject.model, {});
    const Camera& full = subject.test.views.front().camera;
    for (const double scale : options.scales) {
        const Camera camera = resized(full, std::max(1, static_cast<int>(std::lround(full.width * scale))),
                                      std::max(1, static_cast<int>(std::lround(full.height * scale))));
        works.push_back({"rendering, " + std::to_string(camera.width) + "x" + std::to_string(camera.height),
                         static_cast<double>(camera.width) * camera.height,
                         [&renderer, camera] { renderer.render(camera); }});
    }

    // Every series at every number of threads, in turn.
    const std::vector<int> counts = threadCounts(threadCount());
    std::vector<std::function<void()>> bodies;
    for (const Work& work : works)
        for (const int threads : counts)
            bodies.push_back([&work, threads] {
                const ThreadLimit limit(threads);
                work.run();
            });
    constexpr double kSampleSeconds = 0.05;  // a step of 512 rays takes but a few milliseconds
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = options.repeats, .min_sample_s = kSampleSeconds, .calls = kSmoothEvery}, "scaling",
                   report);

    for (std::size_t w = 0; w < works.size(); ++w) {
        const Timing* const timing = &timings[w * counts.size()];  // one entry per number of threads
        std::vector<std::pair<int, double>> relative;
        for (std::size_t c = 0; c < counts.size(); ++c) {
            BenchRow row{works[w].series,
                         std::to_string(counts[c]) + (counts[c] == 1 ? " thread" : " threads"),
                         {{static_cast<double>(counts[c])}, timing[c].wall_s, timing[c].cpu_s, {}, {}}};
            for (std::size_t r = 0; r < timing[c].wall_s.size(); ++r) {
                row.cells[3].push_back(works[w].rays / timing[c].wall_s[r]);
                row.cells[4].push_back(timing[0].wall_s[r] / timing[c].wall_s[r]);
            }
            // Times relative to one thread's of the same round: a machine that slows down between rounds is no
            // share.
            relative.emplace_back(counts[c], 1 / summarize(row.cells[4]).median);
            result.rows.push_back(std::move(row));
        }
        if (counts.size() == 1) continue;
        const double share = serialShare(relative);
        result.figures.emplace_back(kShare + works[w].series, share);
        result.figures.emplace_back(kPrediction + works[w].series, amdahlSpeedup(share, kPredicted));
    }
    addGradientOrder(subject, options, report, result);
    result.figures.emplace_back(
        "share of training rays that meet something",
        1 - static_cast<double>(first_step.trace.rays_skipped) / static_cast<double>(first_step.rays));
    result.notes.push_back("training steps are done with all rates zero, on the finished model");
    return result;
}

Plot scalingPlot(const BenchResult& result) {
    Plot plot = plotColumns(result, "threads", "speedup");
    plot.x = {.label = "threads", .is_log = true, .ticks = {1, 2, 4, 8, 16, 32, 64, 128, 256}};
    plot.y = {.label = "speed-up over one thread; dashed: Amdahl's law from the measured serial share",
              .begins_at_zero = true};
    for (const auto& [name, share] : result.figures) {
        if (name.rfind(kShare, 0) != 0) continue;
        const std::string measured = name.substr(std::string(kShare).size());
        PlotSeries predicted{measured + ", predicted", {}, Stroke::dashed, false};
        for (std::size_t s = 0; s < plot.series.size(); ++s)
            if (plot.series[s].name == measured) predicted.drawn_like = static_cast<int>(s);
        for (int threads = 1; threads <= kPredicted; ++threads)
            predicted.points.push_back({static_cast<double>(threads), amdahlSpeedup(share, threads)});
        plot.series.push_back(std::move(predicted));
    }
    return plot;
}

}  // namespace nerfvdb
