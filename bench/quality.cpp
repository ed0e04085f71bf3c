// SPDX-License-Identifier: Apache-2.0
#include "bench/quality.h"

#include "bench/number_text.h"
#include "bench/result_plot.h"
#include "bench/scratch_folder.h"
#include "bench/stopwatch.h"
#include "core/error.h"
#include "trainer/evaluate.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

const char* presetName(Preset preset) {
    switch (preset) {
        case Preset::fast:
            return "fast";
        case Preset::standard:
            return "default";
        case Preset::best:
            return "best";
    }
    return "";
}

/// Passes progress and warnings on, and asks training to stop once the clock has reached a moment; then the clock stands
/// still, because what follows (checkpoint, pruning, scoring) is no training.
class LookReport : public Report {
public:
    LookReport(Report& outer, Stopwatch& watch, double due_s) : outer_(outer), watch_(watch), due_s_(due_s) {}

    void begin(const std::string& stage, std::int64_t total) override {
        watch_.start();  // a resumed run has read its checkpoint by now
        outer_.begin(stage, total);
    }
    void replan(std::int64_t total) override { outer_.replan(total); }
    void update(std::int64_t done, const std::string& note) override { outer_.update(done, note); }
    void end() override { outer_.end(); }
    void warn(const std::string& line) override { outer_.warn(line); }
    bool cancelled() const override {
        if (!is_due_ && (outer_.cancelled() || watch_.wallSeconds() >= due_s_)) {
            is_due_ = true;
            watch_.pause();
        }
        return is_due_;
    }

private:
    Report& outer_;
    Stopwatch& watch_;
    const double due_s_;
    mutable bool is_due_ = false;
};

/// What one training run, or one look at it, came to.
struct Outcome {
    double seconds = 0, cpu_seconds = 0;
    Evaluation score;
    std::int64_t steps = 0;
    std::uint64_t rays = 0;
    std::size_t voxels = 0, bytes = 0;
};

class QualityRuns {
public:
    QualityRuns(const BenchScene& scene, const QualityOptions& options, Report& report)
        : scene_(scene),
          options_(options),
          report_(report),
          scratch_(options.scratch),
          held_out_(scene.load(Split::test, report)) {
        limitViews(held_out_, options.views);
    }

    /// Load, train for a time, save: what `nerfvdb train DATA --out MODEL --time T` does.
    Outcome separateRun(double time_s, std::uint64_t seed) {
        Stopwatch watch;
        watch.start();
        const Dataset dataset = scene_.load(Split::train, report_);
        TrainOptions training;
        training.time_s = time_s;
        training.seed = seed;
        training.elapsed_s = watch.wallSeconds();
        std::uint64_t rays = 0;
        const TrainResult result = train(
            dataset, training, report_, [&](const TrainProgress& progress) { rays = progress.rays; },
            scratch_ / "model.ckpt");
        saveModel(result.model, scratch_ / "model.vdb");
        watch.pause();
        if (result.interrupted) throw Interrupted("stopped while training, as asked");
        return outcome(result, watch, rays);
    }

    /// One run of a preset; look(label, outcome) is called on its way and at its end.
    void watchedRun(Preset preset, std::uint64_t seed,
                    const std::function<void(const std::string&, const Outcome&)>& look) {
        Stopwatch watch;
        watch.start();
        const Dataset dataset = scene_.load(Split::train, report_);
        TrainOptions training;
        training.preset = preset;
        if (options_.preset_steps > 0) training.steps = {options_.preset_steps};
        training.seed = seed;
        std::uint64_t rays = 0;
        const auto on_interval = [&](const TrainProgress& progress) { rays = progress.rays; };
        double due_s = options_.first_look_s;
        for (bool resume = false;; resume = true) {
            LookReport until(report_, watch, due_s);
            const TrainResult result =
                train(dataset, training, until, on_interval, scratch_ / "model.ckpt", resume);
            if (!result.interrupted) {
                saveModel(result.model, scratch_ / "model.vdb");
                watch.pause();
                look("end", outcome(result, watch, rays));
                return;
            }
            if (report_.cancelled()) throw Interrupted("stopped while training, as asked");
            if (!result.checkpoint_error.empty()) throw IoError(result.checkpoint_error);
            saveModel(result.model, scratch_ / "model.vdb");
            look(numberText(due_s) + " s", outcome(result, watch, rays));
            // A step may last longer than the time between two looks.
            while (due_s <= watch.wallSeconds()) due_s *= 2;
        }
    }

private:
    Outcome outcome(const TrainResult& result, const Stopwatch& watch, std::uint64_t rays) {
        Outcome outcome;
        outcome.seconds = watch.wallSeconds();
        outcome.cpu_seconds = watch.cpuSeconds();
        outcome.steps = result.steps;
        outcome.rays = rays;
        outcome.voxels = result.active_voxels;
        outcome.bytes = std::filesystem::file_size(scratch_ / "model.vdb");
        // What the file keeps is what users get.
        outcome.score = evaluate(loadModel(scratch_ / "model.vdb"), held_out_, {}, report_);
        return outcome;
    }

    const BenchScene& scene_;
    const QualityOptions& options_;
    Report& report_;
    ScratchFolder scratch_;
    Dataset held_out_;
};

/// The row of this name, made if it is new: seeds add to the cells of one row.
BenchRow& rowOf(BenchResult& result, const std::string& series, const std::string& label) {
    for (BenchRow& row : result.rows)
        if (row.series == series && row.label == label) return row;
    result.rows.push_back({series, label, std::vector<std::vector<double>>(result.columns.size())});
    return result.rows.back();
}

void addOutcome(BenchResult& result, const std::string& series, const std::string& label,
                const Outcome& outcome) {
    const double values[] = {outcome.seconds,
                             outcome.cpu_seconds,
                             outcome.score.psnr,
                             outcome.score.ssim,
                             static_cast<double>(outcome.steps),
                             static_cast<double>(outcome.rays),
                             static_cast<double>(outcome.voxels),
                             static_cast<double>(outcome.bytes)};
    BenchRow& row = rowOf(result, series, label);
    for (std::size_t c = 0; c < std::size(values); ++c) row.cells[c].push_back(values[c]);
}

}  // namespace

BenchResult benchQuality(std::span<const BenchScene> scenes, const QualityOptions& options, Report& report) {
    if (scenes.empty()) throw UsageError("bench quality", "no scene", "at least one");
    BenchResult result;
    result.kind = "quality";
    result.title = "Quality of held-out views against training time";
    result.facts = gatherFacts();
    // How long a run takes is what was asked for; how good it is then depends on the machine.
    result.columns = {{"seconds", "s", Better::neither, Noise::timed},
                      {"cpu_seconds", "s", Better::neither, Noise::timed},
                      {"psnr", "dB", Better::higher, Noise::noisy, 0, 0.05},
                      {"ssim", "", Better::higher, Noise::noisy, 0, 0.001},
                      {"steps", "", Better::neither, Noise::timed},
                      {"rays", "", Better::higher, Noise::timed, 0.03, 0},
                      {"voxels", "", Better::neither, Noise::noisy},
                      {"model_bytes", "B", Better::lower, Noise::noisy, 0.03, 0}};
    for (const BenchScene& scene : scenes) {
        QualityRuns runs(scene, options, report);
        for (int seed = 1; seed <= options.seeds; ++seed) {
            for (const double time_s : options.times_s)
                addOutcome(result, scene.name, numberText(time_s) + " s",
                           runs.separateRun(time_s, static_cast<std::uint64_t>(seed)));
            for (const Preset preset : options.presets)
                runs.watchedRun(preset, static_cast<std::uint64_t>(seed),
                                [&](const std::string& label, const Outcome& outcome) {
                                    addOutcome(result, scene.name + ", " + presetName(preset), label, outcome);
                                });
        }
    }
    if (!options.times_s.empty())
        result.notes.push_back("a row per time is a run of its own: load, train, save");
    if (!options.presets.empty())
        result.notes.push_back(
            "rows of a preset are looks at one run on its way; only its end was planned to be one");
    if (options.views > 0)
        result.notes.push_back("at most " + std::to_string(options.views) + " held-out views were scored");
    return result;
}

Plot qualityPlot(const BenchResult& result) {
    Plot plot = plotColumns(result, "seconds", "psnr");
    plot.x.label = "wall time, s";
    plot.y.label = "PSNR of held-out views, dB";
    plot.x.is_log = true;
    markFront(plot);
    return plot;
}

}  // namespace nerfvdb
