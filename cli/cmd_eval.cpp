// SPDX-License-Identifier: Apache-2.0
// nerfvdb eval: how close a model comes to photographs that it has not seen.
#include <array>

#include "cli/commands.h"
#include "cli/dataset_words.h"
#include "cli/debug_ray.h"
#include "cli/output_path.h"
#include "cli/photo_words.h"
#include "cli/pictures_for_eyes.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "cli/scene_words.h"
#include "core/error.h"
#include "trainer/block_index.h"
#include "trainer/evaluate.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct EvalWords {
    SceneWords scene;
    std::string data, save, beside, debug_ray;
    DatasetWords dataset;
    PhotoWords photos;
    int every = 1;
    SharedOptions shared;
};

double ratio(std::uint64_t part, std::uint64_t whole) {
    return whole ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

Json evaluationJson(const Evaluation& evaluation, const Dataset& dataset) {
    const TraceCounters& counters = evaluation.counters;
    Json json = {{"command", "eval"},
                 {"psnr", evaluation.psnr},
                 {"ssim", evaluation.ssim},
                 {"masked_share", evaluation.masked_share},
                 {"seconds_per_frame", evaluation.seconds_per_frame},
                 {"samples_per_ray", ratio(counters.samples_density, counters.rays)},
                 {"feature_samples_per_ray", ratio(counters.samples_features, counters.rays)},
                 {"dense_samples_per_ray", ratio(counters.samples_dense, counters.rays)},
                 {"feature_share_of_dense", ratio(counters.samples_features, counters.samples_dense)},
                 {"rays_skipped_share", ratio(counters.rays_skipped, counters.rays)},
                 {"peak_memory_bytes", peakMemoryBytes()},
                 {"views", Json::array()}};
    for (const ViewScore& view : evaluation.views)
        json["views"].push_back({{"index", view.index},
                                 {"image", dataset.views[view.index].path.string()},
                                 {"psnr", view.psnr},
                                 {"ssim", view.ssim},
                                 {"masked_share", view.masked_share},
                                 {"seconds", view.seconds}});
    return json;
}

std::string evaluationText(const Evaluation& evaluation) {
    const TraceCounters& counters = evaluation.counters;
    return formatted("%zu views: PSNR %.3f dB, SSIM %.4f, %.3f s a frame\n", evaluation.views.size(),
                     evaluation.psnr, evaluation.ssim, evaluation.seconds_per_frame) +
           (evaluation.masked_share > 0
                ? formatted("%.1f %% of the pixels are masked and were not compared\n", 100 * evaluation.masked_share)
                : std::string()) +
           formatted(
               "per ray: %.1f samples, %.1f with features (%.2f %% of a dense march); %.1f %% of rays "
               "skipped\n",
               ratio(counters.samples_density, counters.rays), ratio(counters.samples_features, counters.rays),
               100 * ratio(counters.samples_features, counters.samples_dense),
               100 * ratio(counters.rays_skipped, counters.rays));
}

void runEval(const EvalWords& words) {
    const auto limit = words.shared.begin();
    if (!words.save.empty()) prepareOutputFolder("--save", words.save);
    if (!words.beside.empty()) prepareOutputFolder("--beside", words.beside);
    if (!words.save.empty() && !words.beside.empty() && std::filesystem::equivalent(words.save, words.beside))
        throw UsageError("--beside", "the folder of --save", "another folder", "their files have the same names");
    TerminalReport report;
    DatasetOptions photographs;
    words.photos.apply(photographs);
    if (!words.debug_ray.empty()) {
        if (isBlockFolder(words.scene.path()))
            throw UsageError("--debug-ray", "a folder of blocks", "one of its models",
                             "'nerfvdb info " + words.scene.path() + "' lists them");
        photographs.load_photos = false;
        const Dataset cameras = words.dataset.read(words.data, photographs, report);
        const ReplayedRay ray =
            replayPixel(loadModel(words.scene.path()), cameras, parseDebugPixel(words.debug_ray, cameras));
        return words.shared.finish(replayJson(ray), replayText(ray));
    }
    const std::unique_ptr<Scene> scene = words.scene.load(false);
    const Dataset dataset = words.dataset.read(words.data, photographs, report);

    const auto save = [&](const ViewScore& score, const RenderedImage& picture, const Image& truth) {
        const std::string name = formatted("%04zu.png", score.index);
        if (!words.save.empty()) writeImage(std::filesystem::path(words.save) / name, picture.rgb);
        if (!words.beside.empty())
            writeImage(std::filesystem::path(words.beside) / name,
                       sideBySide(std::array{truth, picture.rgb, depthForEyes(picture.depth)}));
    };
    const Evaluation evaluation = evaluate([&](const Camera& camera) { return scene->render(camera); },
                                           scene->background(), dataset, words.every, report, save);
    Json json = evaluationJson(evaluation, dataset);
    json["downscale"] = words.photos.downscale();
    words.shared.finish(json, evaluationText(evaluation));
}

}  // namespace

Command addEval(CLI::App& program) {
    auto words = std::make_shared<EvalWords>();
    CLI::App& app = *program.add_subcommand("eval", "Score a model or a volume against photographs: PSNR, SSIM, time");
    words->scene.add(app);
    app.add_option("DATA", words->data, "The data set, as for train")->required();
    words->dataset.add(app);
    words->photos.add(app);
    app.add_option("--every", words->every, "Score each Nth view only [1]")
        ->check(positive())
        ->type_name("N");
    app.add_option("--save", words->save, "Write the rendered views there: 0000.png, ... by index of the view")
        ->type_name("DIR");
    app.add_option("--beside", words->beside,
                   "Write photograph, rendered view and depth (near is white) there, side by side: 0000.png, ...")
        ->type_name("DIR");
    app.add_option("--debug-ray", words->debug_ray,
                   "Instead of scoring, print each sample of the ray through one pixel of a model's picture; IMAGE is "
                   "the view's number or the end of its file's path; JITTER, 0.0 to below 1.0, is where samples begin [0.5]")
        ->type_name("IMAGE:X:Y[:JITTER]");
    words->shared.add(app, "  nerfvdb eval lego.vdb data/lego --split test --json scores.json\n"
                           "  nerfvdb eval fox.vdb data/fox --beside views");
    return {&app, [words] { runEval(*words); }};
}

}  // namespace nerfvdb
