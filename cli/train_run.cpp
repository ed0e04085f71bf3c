// SPDX-License-Identifier: Apache-2.0
#include "cli/train_run.h"

#include <algorithm>

#include "cli/csv_log.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/text.h"
#include "core/clock.h"
#include "core/error.h"
#include "trainer/downscale.h"
#include "trainer/memory_plan.h"
#include "trainer/model_cameras.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

Dataset readPhotographs(const TrainRun& run, Report& report) {
    DatasetOptions photographs = run.photographs;
    if (!run.cache.empty()) photographs.max_photo_bytes = 0;
    else if (run.options.max_memory_bytes) photographs.max_photo_bytes = photographRoom(*run.options.max_memory_bytes);
    photographs.cache_folder = run.cache.empty() ? run.out.parent_path() : run.cache;
    Dataset dataset = readDataset(run.data, Split::train, photographs, report);
    if (!dataset.views.empty()) {
        const Camera& camera = dataset.views.front().camera;
        report.info(formatted("%zu training views, the first of %dx%d", dataset.views.size(), camera.width,
                              camera.height));
    }
    return dataset;
}

Json outcomeJson(const TrainRun& run, const TrainResult& result, const Dataset& dataset, std::size_t held_out) {
    return {{"command", "train"},
            {"model", run.out.string()},
            {"train_seconds", secondsSinceProcessStart()},
            {"cpu_seconds", processCpuSeconds()},
            {"steps", result.steps},
            {"schedule", result.model.info.schedule},
            {"train_psnr", result.model.info.train_psnr},
            {"active_voxels", result.active_voxels},
            {"model_bytes", std::filesystem::file_size(run.out)},
            {"peak_memory_bytes", peakMemoryBytes()},
            {"seed", result.model.info.seed},
            {"views", dataset.views.size()},
            {"held_out_views", held_out},
            {"downscale", run.photographs.downscale},
            {"masked_share", maskedShare(dataset)},
            {"exposure_learned", !result.gains.empty()},
            {"exposure_gains", result.gains},
            {"interrupted", result.interrupted},
            {"undone_steps", result.undone_steps},
            {"checkpoints", result.checkpoints},
            {"checkpoint_seconds", result.checkpoint_seconds},
            {"notes", result.notes}};
}

std::string outcomeText(const TrainRun& run, const TrainResult& result) {
    std::string text =
        formatted("%s: %lld steps, %.2f dB on the training rays, %zu active voxels, %s\n", run.out.c_str(),
                  static_cast<long long>(result.steps), result.model.info.train_psnr, result.active_voxels,
                  sizeText(static_cast<double>(std::filesystem::file_size(run.out))).c_str());
    text += formatted("%s in all, %s of the processor's, at most %s of memory\n",
                      durationText(secondsSinceProcessStart()).c_str(), durationText(processCpuSeconds()).c_str(),
                      sizeText(static_cast<double>(peakMemoryBytes())).c_str());
    if (!result.gains.empty()) {
        const auto [low, high] = std::minmax_element(result.gains.begin(), result.gains.end());
        text += formatted("photographs show a mid grey %.2f to %.2f times as bright as the model does\n", *low, *high);
    }
    return text;
}

}  // namespace

std::filesystem::path besideModel(const std::filesystem::path& model, const char* extension) {
    return std::filesystem::path(model).replace_extension(extension);
}

void checkOutputs(const TrainRun& run) {
    for (const char* extension : {".vdb", ".ckpt", ".csv"}) prepareOutputFile("--out", besideModel(run.out, extension));
    if (!run.cache.empty()) prepareOutputFolder("--cache", run.cache);
    const std::filesystem::path checkpoint = besideModel(run.out, ".ckpt");
    if (run.resume && !std::filesystem::exists(checkpoint))
        throw IoError(checkpoint.string(), "no file", "the checkpoint that --resume continues",
                      "train without --resume first");
}

TrainOutcome trainToFiles(const TrainRun& run, Report& report) {
    const Dataset dataset = readPhotographs(run, report);
    std::vector<ModelCamera> held_out = heldOutCameras(run.data, report);
    if (const auto& choose = run.photographs.choose)
        std::erase_if(held_out, [&](const ModelCamera& view) { return !choose(view.camera); });
    for (ModelCamera& view : held_out) view.camera = downscaled(view.camera, run.photographs.downscale);

    CsvLog log(besideModel(run.out, ".csv"), run.resume, report);
    TrainOptions options = run.options;
    options.elapsed_s = secondsSinceProcessStart();
    TrainResult result = train(
        dataset, options, report, [&](const TrainProgress& progress) { log.add(progress); },
        besideModel(run.out, ".ckpt"), run.resume);
    report.end();
    result.model.cameras.insert(result.model.cameras.end(), held_out.begin(), held_out.end());
    try {
        saveModel(result.model, run.out);
    } catch (const NumericError& error) {
        if (result.numeric_error.empty()) throw;
        throw NumericError(result.numeric_error + "; " + error.what() +
                           "; the last checkpoint and model are as they were");
    }
    log.finish();

    return {outcomeJson(run, result, dataset, held_out.size()), outcomeText(run, result),
            result.interrupted ? "stopped at step " + std::to_string(result.steps) + " as asked, and " : "",
            result.numeric_error, result.checkpoint_error};
}

void throwUnlessWhole(const TrainOutcome& outcome, const std::filesystem::path& out, const std::string& to_go_on) {
    const std::string saved = outcome.stopped + "saved " + out.string();
    if (!outcome.numeric_error.empty())
        throw NumericError(outcome.numeric_error + "; saved what was learned before as " + out.string());
    if (!outcome.checkpoint_error.empty())
        throw IoError(saved + ", but not its checkpoint: " + outcome.checkpoint_error);
    if (!outcome.stopped.empty()) throw Interrupted(saved + "; " + to_go_on + " goes on");
}

}  // namespace nerfvdb
