// SPDX-License-Identifier: Apache-2.0
// nerfvdb prepare: photographs without poses -> a data set, by running COLMAP.
#include <map>

#include "cli/commands.h"
#include "trainer/prepare_photos.h"

namespace nerfvdb {
namespace {

struct PrepareWords {
    std::string images, out, matching = "auto", camera = "auto";
    PrepareOptions options;
    SharedOptions shared;
};

Json secondsJson(const std::optional<double>& seconds) { return seconds ? Json(*seconds) : Json(nullptr); }

void runPrepare(const PrepareWords& words) {
    static const std::map<std::string, Matching> kMatchings = {{"auto", Matching::automatic},
                                                               {"exhaustive", Matching::exhaustive},
                                                               {"sequential", Matching::sequential},
                                                               {"spatial", Matching::spatial}};
    static const std::map<std::string, CameraSharing> kCameras = {{"auto", CameraSharing::automatic},
                                                                  {"shared", CameraSharing::shared},
                                                                  {"per-image", CameraSharing::per_image}};
    const auto limit = words.shared.begin();
    PrepareOptions options = words.options;
    options.matching = kMatchings.at(words.matching);
    options.camera = kCameras.at(words.camera);
    TerminalReport report;
    const PreparedPhotos result = preparePhotos(words.images, words.out, options, report);
    report.end();

    const std::size_t registered = result.model_sizes.front();
    const Json json = {{"command", "prepare"},
                       {"data", words.out},
                       {"photographs", result.photos},
                       {"registered", registered},
                       {"unregistered", result.unregistered},
                       {"models", result.model_sizes},
                       {"points", result.points},
                       {"reprojection_error_pixels", secondsJson(result.reprojection_error)},
                       {"matching", nameOf(result.plan.matching)},
                       {"matching_reason", result.plan.matching_reason},
                       {"pairs", result.plan.pairs},
                       {"shared_camera", result.plan.camera == CameraSharing::shared},
                       {"predicted_seconds",
                        {{"features", result.plan.features_seconds}, {"matching", result.plan.matching_seconds},
                         {"matching_from_features", result.predicted_matching_seconds}}},
                       {"seconds",
                        {{"features", secondsJson(result.seconds.features)},
                         {"matching", secondsJson(result.seconds.matching)},
                         {"mapping", secondsJson(result.seconds.mapping)}}}};
    std::string text = formatted("%s: %zu of %zu photographs have a camera, %zu points", words.out.c_str(), registered,
                                 result.photos, result.points);
    if (result.reprojection_error)
        text += formatted(", seen %.2f pixels from where they should be", *result.reprojection_error);
    words.shared.finish(json, text + "\nnext: nerfvdb info " + words.out + "; nerfvdb train " + words.out +
                                  " --out model.vdb\n");
}

}  // namespace

Command addPrepare(CLI::App& program) {
    auto words = std::make_shared<PrepareWords>();
    CLI::App& app = *program.add_subcommand("prepare", "Find out where photographs were taken, with COLMAP");
    app.add_option("IMAGES", words->images, "Folder of photographs, .jpg or .png")->required();
    app.add_option("--out", words->out,
                   "The data set: images/ (hard links to the photographs, copies on another disk), sparse/ (cameras and "
                   "points), colmap/ (database and logs). Called again, it goes on where it was stopped")
        ->required()
        ->type_name("DATA");
    app.add_option("--matching", words->matching,
                   "Which pairs are compared: exhaustive (all), sequential (neighbours in the order of names), spatial "
                   "(neighbours by the places in their EXIF), or auto: spatial where all have places, all pairs up to "
                   "60 photographs, sequential where names are numbered in long runs [auto]")
        ->check(CLI::IsMember({"auto", "exhaustive", "sequential", "spatial"}))
        ->type_name("NAME");
    app.add_option("--camera", words->camera,
                   "shared: one lens for all; per-image; or auto: shared where size, camera and focal length are the "
                   "same [auto]")
        ->check(CLI::IsMember({"auto", "shared", "per-image"}))
        ->type_name("NAME");
    app.add_option("--camera-model", words->options.camera_model, "Lens model, by COLMAP's name [OPENCV]")
        ->check(CLI::IsMember({"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE",
                               "FULL_OPENCV"}))
        ->type_name("NAME");
    app.add_option("--max-size", words->options.max_size,
                   "Seek features in pictures of at most so many pixels along the longer side; photographs themselves "
                   "stay as they are [1600]")
        ->check(CLI::Range(100, 20000))
        ->type_name("N");
    app.add_option("--max-features", words->options.max_features,
                   "At most so many features in a photograph; the time of matching grows with their square [4096]")
        ->check(CLI::Range(100, 100000))
        ->type_name("N");
    app.add_flag("--force", words->options.force, "Begin anew: removes sparse/ and colmap/ of --out first");
    words->shared.add(app,
                      "  nerfvdb prepare photos/ --out data/garden\n"
                      "\nNeeds the program colmap (sudo apt install colmap); no GPU. Ctrl-C keeps what is done.");
    return {&app, [words] { runPrepare(*words); }};
}

}  // namespace nerfvdb
