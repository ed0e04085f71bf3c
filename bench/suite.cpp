// SPDX-License-Identifier: Apache-2.0
#include "bench/suite.h"

#include "bench/kernel_rates.h"
#include "bench/mesh_rates.h"
#include "bench/quality.h"
#include "bench/render_sweep.h"
#include "bench/result_plot.h"
#include "bench/scaling.h"
#include "bench/scene.h"
#include "bench/skip.h"

namespace nerfvdb {
namespace {

/// How much of everything.
struct Extent {
    std::vector<std::string> scenes;
    SyntheticDatasetOptions pictures;
    std::vector<double> times_s;
    int scored_views, judged_views, repeats, seeds;
    double learn_seconds, kernel_sample_s;
    int mesh_resolution;
};

Extent extentOf(SuiteSize size) {
    SyntheticDatasetOptions pictures;
    pictures.val_views = 0;
    if (size == SuiteSize::quick) {
        pictures.train_views = 30, pictures.test_views = 6;
        return {{"demo", "thin"}, pictures, {5, 10, 20}, 6, 2, 3, 1, 20, 0.02, 256};
    }
    pictures.train_views = 60, pictures.test_views = 20;
    pictures.width = pictures.height = 400;
    return {{"demo", "thin", "glossy", "fog"}, pictures, {20, 60, 120}, 0, 4, 7, 3, 60, 0.1, 512};
}

}  // namespace

void runSuite(const SuiteOptions& options, Report& report,
              const std::function<void(const BenchResult&)>& on_result) {
    Extent extent = extentOf(options.size);
    if (options.repeats > 0) extent.repeats = options.repeats;
    const auto keep = [&](const BenchResult& result, const Plot& plot) {
        writeResult(result, plot, options.folder);
        on_result(result);
    };

    std::vector<BenchScene> scenes;
    for (const std::filesystem::path& path : options.data) scenes.push_back(sceneOnDisk(path));
    if (scenes.empty())
        for (const std::string& name : extent.scenes)
            scenes.push_back(proceduralScene(name, extent.pictures, report));
    const BenchResult quality = benchQuality(scenes,
                                             {.times_s = extent.times_s,
                                              .seeds = extent.seeds,
                                              .views = extent.scored_views,
                                              .scratch = options.folder},
                                             report);
    keep(quality, qualityPlot(quality));

    SubjectOptions subject_options{.learn_seconds = extent.learn_seconds, .test_views = extent.judged_views};
    const Subject subject = learnSubject(scenes.front(), subject_options, report);
    const BenchResult render = benchRender(subject, {.repeats = extent.repeats}, report);
    keep(render, renderPlot(render));
    const BenchResult scaling = benchScaling(subject, {.repeats = extent.repeats}, report);
    keep(scaling, scalingPlot(scaling));
    const BenchResult skip = benchSkip(subject, {.repeats = extent.repeats}, report);
    keep(skip, skipPlot(skip));
    const BenchResult kernels =
        benchKernels({.repeats = extent.repeats, .min_sample_s = extent.kernel_sample_s}, report);
    keep(kernels, kernelPlot(kernels));
    const BenchResult mesh = benchMesh(
        {.repeats = extent.repeats, .resolution = extent.mesh_resolution, .scratch = options.folder}, report);
    keep(mesh, meshPlot(mesh));
}

}  // namespace nerfvdb
