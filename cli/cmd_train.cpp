// SPDX-License-Identifier: Apache-2.0
// nerfvdb train: photographs in; model.vdb, model.ckpt (for --resume) and model.csv (how it went) out.
#include <map>

#include "cli/block_words.h"
#include "cli/commands.h"
#include "cli/photo_words.h"
#include "cli/quantities.h"
#include "cli/train_blocks.h"
#include "cli/train_run.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

struct TrainWords {
    std::string data, out, preset, time, steps, scene = "auto", background = "auto", exposure = "auto", max_memory, cache,
                checkpoint_every;
    std::vector<double> bounds;
    std::optional<double> voxel_size;
    std::uint64_t seed = TrainOptions{}.seed;
    bool resume = false, strict = false;
    PhotoWords photos;
    BlockWords blocks;
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
    if (!words.checkpoint_every.empty())
        options.checkpoint_s = parseDuration("--checkpoint-every", words.checkpoint_every);
    options.voxel_size = words.voxel_size;
    options.seed = words.seed;
    return options;
}

/// What the checkpoint decides cannot be asked for again.
void checkResume(const CLI::App& app) {
    for (const char* option :
         {"--preset", "--time", "--steps", "--scene", "--background", "--exposure", "--bounds", "--voxel-size", "--seed"})
        if (app.count(option) > 0)
            throw UsageError("--resume", std::string(option) + " too",
                             "plan, seed, background, exposure and box to be those of the checkpoint",
                             "leave out " + std::string(option) + ", or train anew without --resume");
}

void runTrain(const TrainWords& words) {
    const auto limit = words.shared.begin();
    TrainRun run;
    run.data = words.data;
    run.out = words.out;
    run.cache = words.cache;
    run.options = trainOptions(words);
    run.photographs.strict = words.strict;
    words.photos.apply(run.photographs);
    run.resume = words.resume;
    const bool is_file = run.out.extension() == ".vdb";
    if (words.blocks.isGiven() && is_file)
        throw UsageError("--out", "'" + words.out + "'", "the name of a folder for the blocks");
    if (!words.blocks.isGiven()) {
        if (!is_file) throw UsageError("--out", "'" + words.out + "'", "a file name that ends in .vdb");
        checkOutputs(run);
    }

    TerminalReport report;
    const TrainOutcome outcome = words.blocks.isGiven()
                                     ? trainBlocks(run, words.blocks.count(), words.blocks.only(), report)
                                     : trainToFiles(run, report);
    words.shared.finish(outcome.json, outcome.text);
    throwUnlessWhole(outcome, run.out,
                     words.blocks.isGiven() ? "the same command with --resume"
                                            : "nerfvdb train " + words.data + " --out " + words.out + " --resume");
}

}  // namespace

Command addTrain(CLI::App& program) {
    auto words = std::make_shared<TrainWords>();
    CLI::App& app = *program.add_subcommand("train", "Learn a scene from posed photographs");
    app.add_option(
           "DATA", words->data,
           "Folder with transforms_train.json (NeRF-synthetic), transforms.json (instant-ngp, nerfstudio), a sparse "
           "model of COLMAP or poses_bounds.npy (LLFF), or such a .json")
        ->required();
    app.add_option("--out", words->out,
                   "The model; a checkpoint (.ckpt) and a log (.csv, before the first checkpoint .csv.part) are laid "
                   "beside it")
        ->required()
        ->type_name("MODEL.vdb");
    app.add_option("--preset", words->preset,
                   "How many steps, and how much the scene can hold: fast (10000 steps, a minute of an object on two cores; "
                   "voxels of 1/256 of the box), default (20000, five minutes; 1/512, a network twice as wide) or best (57000, "
                   "thirty; 1/512, four times as wide, twice the features). Places take longer: --time says how long "
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
                   "auto: open where photographs have neither alpha nor a plain background, and neither --bounds nor "
                   "--background is given [auto]")
        ->check(CLI::IsMember({"auto", "box", "open"}))
        ->type_name("EXTENT");
    app.add_option("--background", words->background,
                   "What is behind the scene: white, black, random (white behind half the rays, random colours behind the "
                   "others, shown on white), or auto: random where photographs have alpha, else the plain colour before "
                   "which they show an object, else their mean [auto]")
        ->check(CLI::IsMember({"auto", "white", "black", "random"}))
        ->type_name("NAME");
    app.add_option("--exposure", words->exposure,
                   "Learn what exposure and white balance did to each photograph, as an affine map of its colours; the "
                   "model shows the mean of them: on, off, or auto: on where photographs without alpha are found to differ "
                   "in brightness by more than 5 % from those taken nearest [auto]")
        ->check(CLI::IsMember({"auto", "on", "off"}))
        ->type_name("NAME");
    app.add_option("--bounds", words->bounds,
                   "Box of the scene, or the inner box of an open one, in world units [from the data]")
        ->expected(6)
        ->delimiter(',')
        ->type_name("X0 Y0 Z0 X1 Y1 Z1");
    app.add_option("--voxel-size", words->voxel_size,
                   "Edge of a voxel at the end, in world units, in the inner box of an open scene [as fine as photographs show, "
                   "at most 512 along the box, halved in long trainings where cameras are near]")
        ->type_name("LENGTH");
    app.add_option("--max-memory", words->max_memory,
                   "Stop refining where the program would need more: 4GB, 512MiB [what the machine has]. Given, photographs "
                   "that would take more than half of what the program leaves (130 MiB less) are decoded into a file on "
                   "disk and read from there")
        ->type_name("SIZE");
    app.add_option("--cache", words->cache,
                   "Folder for such a file, which has no name and is gone when the program ends [that of --out]; given, "
                   "photographs are read from there in any case")
        ->type_name("DIR");
    words->blocks.add(app);
    app.add_option("--checkpoint-every", words->checkpoint_every,
                   "Time between checkpoints, longer where they would halt training for more than 2 % of it; a second "
                   "thread writes them [60s]")
        ->type_name("DURATION");
    app.add_flag("--resume", words->resume,
                 "Continue from the checkpoint beside --out, on the same data. Plan, seed, background, exposure and "
                 "box are those of the checkpoint: no --preset, --time, --steps, --scene, --background, --exposure, "
                 "--bounds, --voxel-size, --seed");
    app.add_flag("--strict", words->strict, "A frame without its image is an error, not a warning");
    words->photos.add(app);
    app.add_option("--seed", words->seed, "Same seed and --steps, same file, byte for byte [1]")
        ->check(wholeNumber())
        ->type_name("S");
    words->shared.add(app,
                      "  nerfvdb train data/lego --out lego.vdb --time 5m\n"
                      "  nerfvdb train data/town --out town --blocks 4x3 --time 2h\n"
                      "\nCtrl-C finishes the step, saves and leaves with exit code 130.");
    return {&app, [words, &app] {
                if (words->resume && !words->blocks.isGiven()) checkResume(app);
                words->blocks.check(app);
                runTrain(*words);
            }};
}

}  // namespace nerfvdb
