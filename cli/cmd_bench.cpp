// SPDX-License-Identifier: Apache-2.0
// nerfvdb bench: how fast, how good, and what became of it since last time. Words only; the work is in bench/.
#include <algorithm>
#include <map>

#include "bench/compare.h"
#include "bench/error_curves.h"
#include "bench/kernel_rates.h"
#include "bench/mesh_rates.h"
#include "bench/quality.h"
#include "bench/render_sweep.h"
#include "bench/result_plot.h"
#include "bench/scaling.h"
#include "bench/skip.h"
#include "bench/stress.h"
#include "bench/suite.h"
#include "cli/commands.h"
#include "cli/output_path.h"
#include "cli/quantities.h"
#include "cli/stress_words.h"
#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

struct BenchWords {
    std::string out = "bench-results";
    std::vector<std::string> data;  // of quality and all
    std::string model, one_data;    // of the others
    std::vector<std::string> presets, times;
    std::string before, after;
    int repeats = 0, views = 0, seeds = StressOptions{}.seeds;
    bool quick = false;
    SharedOptions shared;
};

using Result = std::pair<BenchResult, Plot>;
using Measure = std::function<Result(const BenchWords&, Report&)>;

Json asJson(const BenchResult& result) { return Json::parse(jsonText(result)); }

int repeatsOf(const BenchWords& words, int quick, int full) {
    return words.repeats > 0 ? words.repeats : words.quick ? quick : full;
}

Result plotted(BenchResult result, Plot (*plotOf)(const BenchResult&)) {
    Plot plot = plotOf(result);
    return {std::move(result), std::move(plot)};
}

/// What render, scaling and skip look at.
Subject subjectOf(const BenchWords& words, Report& report) {
    SubjectOptions options;
    options.model = words.model;
    options.data = words.one_data;
    options.pictures.val_views = 0;
    options.test_views = words.views > 0 ? words.views : words.quick ? 2 : 4;
    if (words.quick) options.learn_seconds = 20, options.pictures.train_views = 30;
    return makeSubject(options, report);
}

Result measureQuality(const BenchWords& words, Report& report) {
    static const std::map<std::string, Preset> kPresets = {
        {"fast", Preset::fast}, {"default", Preset::standard}, {"best", Preset::best}};
    QualityOptions options;
    for (const std::string& name : words.presets) options.presets.push_back(kPresets.at(name));
    for (const std::string& time : words.times) options.times_s.push_back(parseDuration("--times", time));
    if (options.presets.empty() && options.times_s.empty()) {
        if (words.quick)
            options.times_s = {5, 10, 20};
        else
            options.presets = {Preset::fast};
    }
    options.seeds = repeatsOf(words, 1, 1);
    options.views = words.views;
    options.scratch = words.out;

    SyntheticDatasetOptions pictures;
    pictures.val_views = 0;
    if (words.quick) pictures.train_views = 30, pictures.test_views = 6;
    std::vector<BenchScene> scenes;
    for (const std::string& path : words.data) scenes.push_back(sceneOnDisk(path));
    if (scenes.empty())
        for (const char* name : {"demo", "thin", "glossy"})
            scenes.push_back(proceduralScene(name, pictures, report));
    return plotted(benchQuality(scenes, options, report), qualityPlot);
}

Result measureRender(const BenchWords& words, Report& report) {
    return plotted(benchRender(subjectOf(words, report), {.repeats = repeatsOf(words, 3, 7)}, report), renderPlot);
}

Result measureScaling(const BenchWords& words, Report& report) {
    ScalingOptions options;
    options.repeats = repeatsOf(words, 3, 7);
    return plotted(benchScaling(subjectOf(words, report), options, report), scalingPlot);
}

Result measureSkip(const BenchWords& words, Report& report) {
    return plotted(benchSkip(subjectOf(words, report), {.repeats = repeatsOf(words, 3, 7)}, report), skipPlot);
}

Result measureKernels(const BenchWords& words, Report& report) {
    KernelOptions options;
    options.repeats = repeatsOf(words, 3, 7);
    if (words.quick) options.min_sample_s = 0.02;
    return plotted(benchKernels(options, report), kernelPlot);
}

Result measureMesh(const BenchWords& words, Report& report) {
    MeshRateOptions options;
    options.repeats = repeatsOf(words, 3, 7);
    options.scratch = words.out;
    if (words.quick) options.resolution = 256;
    return plotted(benchMesh(options, report), meshPlot);
}

void runMeasure(const BenchWords& words, const Measure& measure) {
    const auto limit = words.shared.begin();
    prepareOutputFolder("--out", words.out);
    TerminalReport report;
    const auto [result, plot] = measure(words, report);
    report.end();
    writeResult(result, plot, words.out);
    words.shared.finish(asJson(result), tableText(result));
}

void runStressSuite(const BenchWords& words) {
    const auto limit = words.shared.begin();
    prepareOutputFolder("--out", words.out);
    TerminalReport report;
    StressOptions options;
    options.is_long = !words.quick;
    options.seeds = words.seeds;
    options.scratch = words.out;
    const StressResult result = runStress(options, report);
    const BenchResult curves = errorCurves({}, report);
    report.end();
    const std::filesystem::path out = words.out;
    writeResult(curves, errorCurvePlot(curves), out);
    writeAtomically(out / "stress.json", stressJson("bench stress", result).dump(2) + "\n");
    writeAtomically(out / "stability.md", stressDocument(result, curves));
    words.shared.finish(stressJson("bench stress", result), stressSummary(result) + "\n" + tableText(curves));
    refuseFailures(result);
}

void runAll(const BenchWords& words) {
    const auto limit = words.shared.begin();
    prepareOutputFolder("--out", words.out);
    TerminalReport report;
    SuiteOptions options;
    options.size = words.quick ? SuiteSize::quick : SuiteSize::full;
    options.folder = words.out;
    options.data.assign(words.data.begin(), words.data.end());
    options.repeats = words.repeats;
    Json results = Json::array();
    std::string text;
    runSuite(options, report, [&](const BenchResult& result) {
        results.push_back(asJson(result));
        text += (text.empty() ? "" : "\n") + tableText(result);
    });
    report.end();
    words.shared.finish({{"command", "bench"}, {"out", words.out}, {"results", results}}, text);
}

void runCompare(const BenchWords& words) {
    const auto limit = words.shared.begin();
    const ComparisonReport report = compareResults(readResult(words.before), readResult(words.after));
    Json json = {{"command", "bench compare"},
                 {"worse", report.count(Verdict::worse)},
                 {"better", report.count(Verdict::better)},
                 {"unclear", report.count(Verdict::unclear)},
                 {"same", report.count(Verdict::same)},
                 {"drift", report.drift},
                 {"warnings", report.warnings},
                 {"changes", Json::array()}};
    for (const Comparison& cell : report.cells)
        if (cell.verdict != Verdict::same)
            json["changes"].push_back({{"series", cell.series},
                                       {"label", cell.label},
                                       {"column", cell.column},
                                       {"verdict", verdictName(cell.verdict)},
                                       {"before", cell.before.median},
                                       {"after", cell.after.median}});
    words.shared.finish(json, comparisonText(report));
    if (report.count(Verdict::worse) > 0)
        throw DataError(words.after,
                        std::to_string(report.count(Verdict::worse)) + " figures worse than in " + words.before,
                        "none", "see the list above");
}

}  // namespace

Command addBench(CLI::App& program) {
    CLI::App& bench = *program.add_subcommand("bench", "Measure speed and quality, and compare measurements");
    auto all = std::make_shared<BenchWords>();
    auto runs = std::make_shared<std::vector<std::pair<CLI::App*, std::function<void()>>>>();
    bench.require_subcommand(0, 1);

    const auto addShared = [](CLI::App& app, const std::shared_ptr<BenchWords>& words,
                              const std::string& example) {
        app.add_option("--out", words->out, "Folder for results: .json, .csv, .svg [bench-results]")
            ->type_name("DIR");
        app.add_option("--repeats", words->repeats, "Measure each figure so many times")
            ->check(CLI::Range(1, 1000))
            ->type_name("N");
        app.add_flag("--quick", words->quick, "Less of everything: seconds instead of minutes");
        words->shared.add(app, example);
    };
    const auto add = [&](const char* name, const char* text, const Measure& measure,
                         const std::string& example) {
        auto words = std::make_shared<BenchWords>();
        CLI::App* const app = bench.add_subcommand(name, text);
        addShared(*app, words, example);
        runs->push_back({app, [words, measure] { runMeasure(*words, measure); }});
        return std::pair<CLI::App&, BenchWords&>(*app, *words);
    };
    const auto addSubject = [](CLI::App& app, BenchWords& words) {
        app.add_option("MODEL", words.model, "A model; without it a scene is learned first")
            ->type_name("MODEL.vdb");
        app.add_option("--data", words.one_data, "The model's data set [pictures of the model itself]")
            ->type_name("DATA");
        app.add_option("--views", words.views, "Look from so many held-out views [4]")
            ->check(CLI::Range(1, 10000))
            ->type_name("N");
    };

    addShared(bench, all,
              "  nerfvdb bench --quick\n  nerfvdb bench quality data/lego --times 20s,1m,2m --out results\n"
              "  nerfvdb bench compare old/render.json new/render.json\n"
              "\nWithout a kind, all kinds are measured, on procedural scenes.");
    const auto addScenes = [&all](CLI::App& app) {
        app.add_option("--data", all->data, "Data sets to learn instead of procedural scenes")
            ->type_name("DATA");
    };
    addScenes(bench);

    {
        const auto [app, words] =
            add("quality", "PSNR and SSIM of held-out views against seconds of training", &measureQuality,
                "  nerfvdb bench quality data/lego data/mic --times 20s,1m,2m");
        app.add_option("DATA", words.data, "Data sets; without any, procedural scenes are made");
        app.add_option("--times", words.times, "A separate run for each: load, train, save")
            ->delimiter(',')
            ->type_name("DURATION,...");
        app.add_option("--presets", words.presets, "One run of each, looked at on its way [fast]")
            ->delimiter(',')
            ->check(CLI::IsMember({"fast", "default", "best"}))
            ->type_name("NAME,...");
        app.add_option("--views", words.views, "Score at most so many held-out views [all]")
            ->check(CLI::Range(1, 100000))
            ->type_name("N");
    }
    {
        const auto [app, words] = add("render", "Error of rendering against time of a frame, for each knob",
                                      &measureRender, "  nerfvdb bench render lego.vdb --data data/lego");
        addSubject(app, words);
    }
    {
        const auto [app, words] =
            add("scaling", "Rays a second on 1, 2, ... threads, and Amdahl's serial share", &measureScaling,
                "  nerfvdb bench scaling lego.vdb --data data/lego");
        addSubject(app, words);
    }
    {
        const auto [app, words] = add("skip", "Time, samples and PSNR with and without each kind of skipping",
                                      &measureSkip, "  nerfvdb bench skip lego.vdb --data data/lego");
        addSubject(app, words);
    }
    add("kernels", "The inner loops on each instruction set, one thread", &measureKernels,
        "  nerfvdb bench kernels");
    add("mesh", "Triangles a second, memory and .vdb voxels a second, beside OpenVDB and VTK", &measureMesh,
        "  nerfvdb bench mesh --quick");

    {
        auto words = std::make_shared<BenchWords>();
        CLI::App* const stress = bench.add_subcommand(
            "stress",
            "Numbers against exact ones, hard input, error against time, seeds; exit code 1 if a promise breaks");
        stress->add_option("--out", words->out,
                           "Folder for stability.md, stress.json and the error curves [bench-results]")
            ->type_name("DIR");
        stress->add_option("--seeds", words->seeds,
                           "Train each procedural scene with so many seeds; 0: not at all [20]")
            ->check(CLI::Range(0, 1000))
            ->type_name("N");
        stress->add_flag("--quick", words->quick, "As selftest: under a minute, without seeds");
        words->shared.add(*stress, "  nerfvdb bench stress --out results");
        runs->push_back({stress, [words] { runStressSuite(*words); }});
    }

    CLI::App* const everything = bench.add_subcommand("all", "All of these but stress, as without a kind");
    addShared(*everything, all, "  nerfvdb bench all --quick --out results");
    addScenes(*everything);
    runs->push_back({everything, [all] { runAll(*all); }});
    auto two = std::make_shared<BenchWords>();
    CLI::App* const compare =
        bench.add_subcommand("compare", "Tell a regression from noise; exit code 1 if worse");
    compare->add_option("BEFORE", two->before, "A .json that bench wrote")->required();
    compare->add_option("AFTER", two->after, "The same benchmark, later")->required();
    two->shared.add(*compare, "  nerfvdb bench compare old/render.json new/render.json");
    runs->push_back({compare, [two] { runCompare(*two); }});

    return {&bench, [all, runs] {
                for (const auto& [app, run] : *runs)
                    if (app->parsed()) return run();
                runAll(*all);
            }};
}

}  // namespace nerfvdb
