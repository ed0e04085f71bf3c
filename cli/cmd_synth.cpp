// SPDX-License-Identifier: Apache-2.0
// nerfvdb synth: a procedural scene as photographs; of scenes in a box, exact density and colour as a volume and a mesh.
#include <algorithm>
#include <optional>

#include "cli/commands.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "core/error.h"
#include "export/marching_cubes.h"
#include "export/mesh_io.h"
#include "export/vdb_export.h"
#include "trainer/open_scene.h"
#include "trainer/sample_scene.h"
#include "trainer/street_scene.h"
#include "trainer/synthetic_scene.h"
#include "trainer/write_dataset.h"

namespace nerfvdb {
namespace {

struct SynthWords {
    std::string name, out;
    SyntheticDatasetOptions dataset;
    std::optional<double> length;
    bool has_views = false;
    int resolution = 256;
    bool no_truth = false;
    SharedOptions shared;
};

/// The scene sampled on a fine grid leaves through the same doors as a trained model.
void writeTruth(const SyntheticScene& scene, const std::filesystem::path& folder, int resolution,
                Report& report, Json& json) {
    report.begin("truth", 0);
    const Model truth = sampleScene(scene, resolution);
    exportVdb(truth, folder / "truth.vdb", {}, report);
    writeMesh(folder / "truth.ply", extractSurface(truth, {}, report));
    report.end();
    json["truth_iso"] = automaticIso(truth.field);
    json["active_voxels"] = truth.field.topology().voxelCount();
}

std::string sceneNames() {
    std::string names;
    for (const std::string& name : syntheticSceneNames()) names += (names.empty() ? "" : ", ") + name;
    for (const std::string& name : openSceneNames()) names += ", " + name;
    return names;
}

bool isOpenScene(const std::string& name) { return std::ranges::count(openSceneNames(), name) > 0; }

/// Pictures alone: a place without bounds has no volume.
Json runOpen(SynthWords& words, const std::filesystem::path& folder, Report& report) {
    const auto scene = makeOpenScene(words.name, words.length);
    if (words.name == "street" && !words.has_views)
        words.dataset.train_views = streetViews(words.length.value_or(kDefaultStreet));
    prepareOutputFolder("--out", folder);
    writeOpenDataset(*scene, folder, words.dataset, report);
    return words.name == "street" ? Json{{"length", words.length.value_or(kDefaultStreet)}} : Json::object();
}

Json runBounded(const SynthWords& words, const std::filesystem::path& folder, Report& report) {
    if (std::ranges::count(syntheticSceneNames(), words.name) == 0)
        throw UsageError("synth", "'" + words.name + "'", "one of " + sceneNames());
    const auto scene = makeSyntheticScene(words.name);
    if (words.length)
        throw UsageError("--length", "the scene '" + words.name + "'", "'street', which alone has a length");
    prepareOutputFolder("--out", folder);
    writeSyntheticDataset(*scene, folder, words.dataset, report);
    Json json = Json::object();
    if (!words.no_truth) writeTruth(*scene, folder, words.resolution, report, json);
    return json;
}

void runSynth(SynthWords words) {
    const auto limit = words.shared.begin();
    const std::filesystem::path folder = words.out;
    const bool is_open = isOpenScene(words.name);

    TerminalReport report;
    const Json more = is_open ? runOpen(words, folder, report) : runBounded(words, folder, report);
    Json json = {{"command", "synth"},
                 {"scene", words.name},
                 {"out", words.out},
                 {"views",
                  {{"train", words.dataset.train_views},
                   {"val", words.dataset.val_views},
                   {"test", words.dataset.test_views}}},
                 {"width", words.dataset.width},
                 {"height", words.dataset.height}};
    json.update(more);
    json["peak_memory_bytes"] = peakMemoryBytes();
    words.shared.finish(json, formatted("%s: %d training, %d validation and %d test views of %dx%d%s\n",
                                        words.out.c_str(), words.dataset.train_views, words.dataset.val_views,
                                        words.dataset.test_views, words.dataset.width, words.dataset.height,
                                        words.no_truth || is_open ? "" : ", and the truth as truth.vdb and truth.ply"));
}

}  // namespace

Command addSynth(CLI::App& program) {
    auto words = std::make_shared<SynthWords>();
    CLI::App& app =
        *program.add_subcommand("synth", "Make a data set of a procedural scene, with its exact truth");
    app.add_option("NAME", words->name, "One of: " + sceneNames())->required();
    app.add_option("--out", words->out, "Folder for images and transforms, and truth.vdb and truth.ply of scenes in a box (all but plaza, "
                   "street and survey)")
        ->required()
        ->type_name("DIR");
    const auto number = [&](const char* name, int& value, const char* text, int low, int high) {
        app.add_option(name, value, std::string(text) + " [" + std::to_string(value) + "]")
            ->check(CLI::Range(low, high))
            ->type_name("N");
    };
    app.add_option("--views", words->dataset.train_views, "Training views [60; of a street, 3 every 5 m]")
        ->check(CLI::Range(1, 10000))
        ->type_name("N");
    number("--val-views", words->dataset.val_views, "Validation views", 0, 10000);
    number("--test-views", words->dataset.test_views, "Test views, from other places", 0, 10000);
    number("--width", words->dataset.width, "Pixels", 16, 8192);
    number("--height", words->dataset.height, "Pixels", 16, 8192);
    app.add_option("--length", words->length, "Metres of the street [200]")->type_name("M");
    number("--resolution", words->resolution, "Voxels along the truth's longest edge", 16, 2048);
    app.add_flag("--no-truth", words->no_truth, "Leave out truth.vdb and truth.ply");
    app.add_option("--seed", words->dataset.seed, "Turns the cameras about the scene [1]")
        ->check(wholeNumber())
        ->type_name("S");
    words->shared.add(app, "  nerfvdb synth demo --out data/demo --views 60 --width 400 --height 400");
    return {&app, [words, &app] {
                words->has_views = app.count("--views") > 0;
                runSynth(*words);
            }};
}

}  // namespace nerfvdb
