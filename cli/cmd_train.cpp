// SPDX-License-Identifier: Apache-2.0
// nerfvdb train: photographs in; model.vdb, model.ckpt (for --resume) and model.csv (how it went) out.
#include <algorithm>
#include <map>

#include "cli/commands.h"
#include "cli/csv_log.h"
#include "cli/output_path.h"
#include "cli/photo_words.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "core/error.h"
#include "trainer/downscale.h"
#include "trainer/model_cameras.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct TrainWords {
    std::string data, out, preset, time, steps, scene = "auto", background = "auto", exposure = "auto", max_memory, cache;
    std::vector<double> bounds;
    std::uint64_t seed = TrainOptions{}.seed;
    bool resume = false, strict = false;
    PhotoWords photos;
    SharedOptions shared;
};

TrainOptions trainOptions(const TrainWords& words) {
    static const std::map<std::string, Preset> kPresets = {
        {"fast", Preset::fast}, {"default", Preset::standard}, {"best", Preset::best}};
    static const std::map<std::string, BackgroundMode> kBackgrounds = {{"auto", BackgroundMode::automatic},
                                                                       {"white", BackgroundMode::white},
                                                                       {"black", BackgroundMode::black},
                                                                       {"random", BackgroundMode::random}};
    static const std::map<std::string, SceneExtent> kExtents = {
        {"auto", SceneExtent::automatic}, {"box", SceneExtent::box}, {"open", SceneExtent::open}};
    static const std::map<std::string, ExposureMode> kExposures = {
        {"auto", ExposureMode::automatic}, {"on", ExposureMode::on}, {"off", ExposureMode::off}};
    TrainOptions options;
    options.extent = kExtents.at(words.scene);
    if (!words.preset.empty()) options.preset = kPresets.at(words.preset);
    options.background = kBackgrounds.at(words.background);
    options.exposure = kExposures.at(words.exposure);
    if (!words.time.empty()) options.time_s = parseDuration("--time", words.time);
    if (!words.steps.empty()) options.steps = parseSteps("--steps", words.steps);
    if (!words.bounds.empty()) options.bounds = parseBounds("--bounds", words.bounds);
    if (!words.max_memory.empty()) options.max_memory_bytes = parseSize("--max-memory", words.max_memory);
    options.seed = words.seed;
    return options;
}

/// What the checkpoint decides cannot be asked for again.
void checkResume(const CLI::App& app) {
    for (const char* option :
         {"--preset", "--time", "--steps", "--scene", "--background", "--exposure", "--bounds", "--seed"})
        if (app.count(option) > 0)
            throw UsageError("--resume", std::string(option) + " too",
                             "plan, seed, background, exposure and box to be those of the checkpoint",
                             "leave out " + std::string(option) + ", or train anew without --resume");
}

void runTrain(const TrainWords& words) {
    const auto limit = words.shared.begin();
    TrainOptions options = trainOptions(words);
    const std::filesystem::path out = words.out;
    if (out.extension() != ".vdb")
        throw UsageError("--out", "'" + words.out + "'", "a file name that ends in .vdb");
    const auto beside = [&](const char* extension) {
        return std::filesystem::path(out).replace_extension(extension);
    };
    for (const char* extension : {".vdb", ".ckpt", ".csv"}) prepareOutputFile("--out", beside(extension));
    if (!words.cache.empty()) prepareOutputFolder("--cache", words.cache);
    const std::filesystem::path checkpoint = beside(".ckpt");
    if (words.resume && !std::filesystem::exists(checkpoint))
        throw IoError(checkpoint.string(), "no file", "the checkpoint that --resume continues",
                      "train without --resume first");

    TerminalReport report;
    DatasetOptions photographs;
    photographs.strict = words.strict;
    words.photos.apply(photographs);
    if (options.max_memory_bytes) photographs.max_photo_bytes = *options.max_memory_bytes / 2;
    photographs.cache_folder = words.cache.empty() ? out.parent_path() : std::filesystem::path(words.cache);
    const Dataset dataset = readDataset(words.data, Split::train, photographs, report);
    if (!dataset.views.empty()) {
        const Camera& camera = dataset.views.front().camera;
        report.info(formatted("%zu training views, the first of %dx%d", dataset.views.size(), camera.width,
                              camera.height));
    }

    std::vector<ModelCamera> held_out = heldOutCameras(words.data, report);
    for (ModelCamera& view : held_out) view.camera = downscaled(view.camera, words.photos.downscale());

    CsvLog log(beside(".csv"), words.resume, report);
    options.elapsed_s = secondsSinceProcessStart();
    TrainResult result = train(
        dataset, options, report, [&](const TrainProgress& progress) { log.add(progress); }, checkpoint,
        words.resume);
    report.end();
    result.model.cameras.insert(result.model.cameras.end(), held_out.begin(), held_out.end());
    try {
        saveModel(result.model, out);
    } catch (const NumericError& error) {
        if (result.numeric_error.empty()) throw;
        throw NumericError(result.numeric_error + "; " + error.what() +
                           "; the last checkpoint and model are as they were");
    }
    log.finish();

    const double seconds = secondsSinceProcessStart();
    const Json json = {{"command", "train"},
                       {"model", out.string()},
                       {"train_seconds", seconds},
                       {"steps", result.steps},
                       {"schedule", result.model.info.schedule},
                       {"train_psnr", result.model.info.train_psnr},
                       {"active_voxels", result.active_voxels},
                       {"model_bytes", std::filesystem::file_size(out)},
                       {"peak_memory_bytes", peakMemoryBytes()},
                       {"seed", result.model.info.seed},
                       {"views", dataset.views.size()},
                       {"held_out_views", held_out.size()},
                       {"downscale", words.photos.downscale()},
                       {"masked_share", maskedShare(dataset)},
                       {"exposure_learned", !result.gains.empty()},
                       {"exposure_gains", result.gains},
                       {"interrupted", result.interrupted},
                       {"undone_steps", result.undone_steps},
                       {"notes", result.notes}};
    std::string text =
        formatted("%s: %lld steps, %.2f dB on the training rays, %zu active voxels, %s\n", out.c_str(),
                  static_cast<long long>(result.steps), result.model.info.train_psnr, result.active_voxels,
                  sizeText(static_cast<double>(std::filesystem::file_size(out))).c_str());
    text += formatted("%s in all, at most %s of memory\n", durationText(seconds).c_str(),
                      sizeText(static_cast<double>(peakMemoryBytes())).c_str());
    if (!result.gains.empty()) {
        const auto [low, high] = std::minmax_element(result.gains.begin(), result.gains.end());
        text += formatted("photographs show a mid grey %.2f to %.2f times as bright as the model does\n", *low, *high);
    }
    words.shared.finish(json, text);
    const std::string stopped =
        result.interrupted ? "stopped at step " + std::to_string(result.steps) + " as asked, and " : "";
    const std::string saved = stopped + "saved " + out.string();
    if (!result.numeric_error.empty())
        throw NumericError(result.numeric_error + "; saved what was learned before as " + out.string());
    if (!result.checkpoint_error.empty())
        throw IoError(saved + ", but not its checkpoint: " + result.checkpoint_error);
    if (result.interrupted)
        throw Interrupted(saved + "; nerfvdb train " + words.data + " --out " + words.out + " --resume goes on");
}

}  // namespace

Command addTrain(CLI::App& program) {
    auto words = std::make_shared<TrainWords>();
    CLI::App& app = *program.add_subcommand("train", "Learn a scene from posed photographs");
    app.add_option(
           "DATA", words->data,
           "Folder with transforms_train.json (NeRF-synthetic) or transforms.json (instant-ngp, nerfstudio), "
           "or such a file")
        ->required();
    app.add_option("--out", words->out,
                   "The model; a checkpoint (.ckpt) and a log (.csv, before the first checkpoint .csv.part) are laid "
                   "beside it")
        ->required()
        ->type_name("MODEL.vdb");
    app.add_option("--preset", words->preset,
                   "How long, and how much the scene can hold: fast (a minute, voxels of 1/256 of the box), default "
                   "(five, 1/512, a network twice as wide) or best (thirty, 1/512, four times as wide, twice the features) "
                   "[default, with the network of fast for --time 90s and less]")
        ->check(CLI::IsMember({"fast", "default", "best"}))
        ->type_name("NAME");
    app.add_option(
           "--time", words->time,
           "Wall time from the start of the program to the file on disk: 90s, 5m, 1h; instead of the preset's")
        ->type_name("DURATION");
    app.add_option("--steps", words->steps,
                   "Number of training steps in all, or of each stage (100,400,2000); overrides --time")
        ->type_name("N");
    app.add_option("--scene", words->scene,
                   "box: all of it lies in a box; open: it goes on without bounds, in ever larger voxels, up to a sky; "
                   "auto: open where photographs have no alpha and neither --bounds nor --background is given [auto]")
        ->check(CLI::IsMember({"auto", "box", "open"}))
        ->type_name("EXTENT");
    app.add_option("--background", words->background,
                   "What is behind the scene: white, black, random (learns opacity, shown on white), or auto: random "
                   "where photographs have alpha, else their mean colour [auto]")
        ->check(CLI::IsMember({"auto", "white", "black", "random"}))
        ->type_name("NAME");
    app.add_option("--exposure", words->exposure,
                   "Learn what exposure and white balance did to each photograph, as an affine map of its colours; the "
                   "model shows the mean of them: on, off, or auto: on where photographs without alpha are found to differ "
                   "by more than 5 % [auto]")
        ->check(CLI::IsMember({"auto", "on", "off"}))
        ->type_name("NAME");
    app.add_option("--bounds", words->bounds,
                   "Box of the scene, or the inner box of an open one, in world units [from the data]")
        ->expected(6)
        ->delimiter(',')
        ->type_name("X0 Y0 Z0 X1 Y1 Z1");
    app.add_option("--max-memory", words->max_memory,
                   "Stop refining where training would need more: 4GB, 512MiB. Photographs that would take more than half "
                   "of it are decoded into a file on disk and read from there")
        ->type_name("SIZE");
    app.add_option("--cache", words->cache,
                   "Folder for that file; it has no name and is gone when the program ends [that of --out]")
        ->type_name("DIR");
    app.add_flag("--resume", words->resume,
                 "Continue from the checkpoint beside --out, on the same data. Plan, seed, background, exposure and "
                 "box are those of the checkpoint: no --preset, --time, --steps, --scene, --background, --exposure, "
                 "--bounds, --seed");
    app.add_flag("--strict", words->strict, "A frame without its image is an error, not a warning");
    words->photos.add(app);
    app.add_option("--seed", words->seed, "Same seed and --steps, same file, byte for byte [1]")
        ->check(CLI::NonNegativeNumber)
        ->type_name("S");
    words->shared.add(app,
                      "  nerfvdb train data/lego --out lego.vdb --time 5m\n"
                      "\nCtrl-C finishes the step, saves and leaves with exit code 130.");
    return {&app, [words, &app] {
                if (words->resume) checkResume(app);
                runTrain(*words);
            }};
}

}  // namespace nerfvdb
