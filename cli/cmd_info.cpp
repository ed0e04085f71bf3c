// SPDX-License-Identifier: Apache-2.0
// nerfvdb info: what a model or a data set holds.
#include <algorithm>
#include <optional>
#include <utility>

#include "cli/commands.h"
#include "core/error.h"
#include "trainer/dataset.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct InfoWords {
    std::string path;
    SharedOptions shared;
};

Json vectorJson(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }
Json boxJson(const Box& box) { return {{"min", vectorJson(box.min)}, {"max", vectorJson(box.max)}}; }

std::string boxText(const Box& box) {
    return formatted("[%.4g, %.4g, %.4g] to [%.4g, %.4g, %.4g]", box.min.x(), box.min.y(), box.min.z(),
                     box.max.x(), box.max.y(), box.max.z());
}

/// One shell of a field.
struct ShellFacts {
    double voxel_size = 0;  // world units
    Box box;
    std::size_t active_voxels = 0, cells = 0;
};

std::vector<ShellFacts> shellFacts(const VoxelField& field) {
    std::vector<ShellFacts> facts(static_cast<std::size_t>(field.shells().count));
    for (int shell = 0; shell < field.shells().count; ++shell) {
        facts[shell].voxel_size = field.frame().voxel_size * Shells::scale(shell);
        facts[shell].box = field.shellBox(shell);
    }
    const Topology& topology = field.topology();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        ShellFacts& shell = facts[field.shells().shellOf(topology.leafCoords()[leaf].x() * kLeafDim)];
        forEachBit(topology.voxels()[leaf], [&](int) { ++shell.active_voxels; });
        forEachBit(topology.cells()[leaf], [&](int) { ++shell.cells; });
    }
    return facts;
}

Json shellsJson(const std::vector<ShellFacts>& shells) {
    Json json = Json::array();
    for (const ShellFacts& shell : shells)
        json.push_back({{"voxel_size", shell.voxel_size},
                        {"bounds", boxJson(shell.box)},
                        {"active_voxels", shell.active_voxels},
                        {"cells", shell.cells}});
    return json;
}

/// Nothing for a scene in one box.
std::string shellsText(const std::vector<ShellFacts>& shells) {
    if (shells.size() == 1) return "";
    std::string text;
    for (std::size_t i = 0; i < shells.size(); ++i)
        text += formatted("shell %zu: voxels of %.4g world units, %zu active, ", i, shells[i].voxel_size,
                          shells[i].active_voxels) +
                boxText(shells[i].box) + "\n";
    return text;
}

void describeModel(const InfoWords& words) {
    const Model model = loadModel(words.path);
    const VoxelField& field = model.field;
    const Topology& topology = field.topology();
    const std::vector<ShellFacts> shells = shellFacts(field);
    const Vec3i dims = shells.size() > 1 ? field.shells().extent : topology.dims();  // of each shell
    const double in_box = dims.cast<double>().prod() * static_cast<double>(shells.size());
    const double share = in_box > 0 ? static_cast<double>(topology.voxelCount()) / in_box : 0;
    const auto file_bytes = std::filesystem::file_size(words.path);
    Json grids = Json::array();
    std::string grids_text;
    for (const GridFacts& grid : listGrids(words.path)) {
        grids.push_back({{"name", grid.name}, {"type", grid.type}, {"active_voxels", grid.active_voxels}});
        grids_text += formatted("grid %s: %s, %zu active voxels (a preview, half the resolution)\n", grid.name.c_str(),
                                grid.type.c_str(), grid.active_voxels);
    }

    const auto held_out =
        std::count_if(model.cameras.begin(), model.cameras.end(), [](const ModelCamera& c) { return c.held_out; });
    const auto trained_on = static_cast<std::ptrdiff_t>(model.cameras.size()) - held_out;

    const Json json = {{"command", "info"},
                       {"kind", "model"},
                       {"grids", grids},
                       {"resolution", {dims.x(), dims.y(), dims.z()}},
                       {"voxel_size", field.frame().voxel_size},
                       {"bounds", boxJson(field.worldBox())},
                       {"shells", shellsJson(shells)},
                       {"sky", model.sky.isEmpty() ? Json(nullptr) : Json({model.sky.width(), model.sky.height()})},
                       {"leaves", topology.leafCount()},
                       {"active_voxels", topology.voxelCount()},
                       {"cells", topology.cellCount()},
                       {"channels", field.channels()},
                       {"density_scale", field.densityScale()},
                       {"decoder_width", model.decoder.width()},
                       {"decoder_parameters", model.decoder.parameters().size()},
                       {"background", {model.background.x(), model.background.y(), model.background.z()}},
                       {"memory_bytes", field.bytes()},
                       {"file_bytes", file_bytes},
                       {"schedule", model.info.schedule},
                       {"seed", model.info.seed},
                       {"train_psnr", model.info.train_psnr},
                       {"cameras", {{"train", trained_on}, {"held_out", held_out}}}};
    const std::string text =
        formatted("model: density and %d features a voxel, a network %d wide (%zu parameters)\n", field.channels(),
                  model.decoder.width(), model.decoder.parameters().size()) +
        grids_text +
        formatted("resolution: %d x %d x %d%s, voxels of %.4g world units\n", dims.x(), dims.y(), dims.z(),
                  shells.size() > 1 ? " in each shell" : "", field.frame().voxel_size) +
        "bounds: " + boxText(field.worldBox()) + "\n" + shellsText(shells) +
        formatted("active voxels: %zu (%.2f %% of the %s) in %zu leaves\n", topology.voxelCount(), 100 * share,
                  shells.size() > 1 ? "shells" : "box", topology.leafCount()) +
        (model.sky.isEmpty() ? formatted("background: %.3g, %.3g, %.3g (sRGB)\n", model.background.x(),
                                         model.background.y(), model.background.z())
                             : formatted("sky: a panorama of %d x %d\n", model.sky.width(), model.sky.height())) +
        "memory: " + sizeText(static_cast<double>(field.bytes())) +
        ", file: " + sizeText(static_cast<double>(file_bytes)) + "\n" +
        formatted("trained: seed %llu, steps %s, %.2f dB on the training rays\n",
                  static_cast<unsigned long long>(model.info.seed),
                  model.info.schedule.c_str(), model.info.train_psnr) +
        (model.cameras.empty()
             ? std::string("cameras: none are told\n")
             : formatted("cameras: %td trained on, %td held out\n", trained_on, held_out));
    words.shared.finish(json, text);
}

/// "800x800" or "800x800 to 1024x800".
std::string sizesText(const Dataset& dataset) {
    const Camera* smallest = &dataset.views.front().camera;
    const Camera* largest = smallest;
    for (const View& view : dataset.views) {
        const auto area = [](const Camera& c) { return static_cast<long long>(c.width) * c.height; };
        if (area(view.camera) < area(*smallest)) smallest = &view.camera;
        if (area(view.camera) > area(*largest)) largest = &view.camera;
    }
    const std::string low = formatted("%dx%d", smallest->width, smallest->height);
    const std::string high = formatted("%dx%d", largest->width, largest->height);
    return low == high ? low : low + " to " + high;
}

Box cameraBox(const Dataset& dataset) {
    Box box{dataset.views.front().camera.position, dataset.views.front().camera.position};
    for (const View& view : dataset.views) {
        box.min = box.min.cwiseMin(view.camera.position);
        box.max = box.max.cwiseMax(view.camera.position);
    }
    return box;
}

/// Reads the split without pictures; an absent one gives nothing, unless it is the one that training needs.
std::optional<Dataset> readSplit(const std::filesystem::path& path, Split split) {
    Report silent;  // warnings are part of the answer here
    try {
        return readDataset(path, split, {.strict = false, .load_photos = false}, silent);
    } catch (const Error&) {
        if (split == Split::train) throw;
        return std::nullopt;
    }
}

bool haveSameViews(const Dataset& a, const Dataset& b) {
    return std::equal(a.views.begin(), a.views.end(), b.views.begin(), b.views.end(),
                      [](const View& u, const View& v) { return u.path == v.path; });
}

void describeDataset(const InfoWords& words) {
    constexpr std::pair<Split, const char*> kSplits[] = {
        {Split::train, "train"}, {Split::val, "val"}, {Split::test, "test"}};
    Json json = {
        {"command", "info"}, {"kind", "data"}, {"splits", Json::object()}, {"warnings", Json::array()}};
    std::string text = "data set: " + words.path + "\n";
    std::vector<std::string> warnings;
    const std::optional<Dataset> test = readSplit(words.path, Split::test);
    for (const auto& [split, name] : kSplits) {
        const std::optional<Dataset> dataset = split == Split::test ? test : readSplit(words.path, split);
        if (!dataset || dataset->views.empty()) {
            text += std::string(name) + ": none\n";
            continue;
        }
        if (split == Split::val && test && haveSameViews(*dataset, *test)) {
            text += "val: none of its own; test serves\n";
            continue;
        }
        const Camera& first = dataset->views.front().camera;
        const Box cameras = cameraBox(*dataset);
        json["splits"][name] = {{"views", dataset->views.size()},   {"width", first.width},
                                {"height", first.height},           {"focal_length", first.fx},
                                {"alpha", dataset->has_alpha},      {"distorted", !first.distortion.isZero()},
                                {"camera_bounds", boxJson(cameras)}};
        text +=
            formatted("%s: %zu views, %s%s%s, focal length %.1f pixels\n    cameras in %s\n", name,
                      dataset->views.size(), sizesText(*dataset).c_str(), dataset->has_alpha ? ", alpha" : "",
                      first.distortion.isZero() ? "" : ", lens distortion", first.fx, boxText(cameras).c_str());
        if (split == Split::train && dataset->aabb_scale) {
            json["aabb_scale"] = *dataset->aabb_scale;
            text += formatted("aabb_scale: %g\n", *dataset->aabb_scale);
        }
        for (const std::string& warning : dataset->warnings)
            if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
                warnings.push_back(warning);
    }
    for (const std::string& warning : warnings) {
        json["warnings"].push_back(warning);
        text += "warning: " + warning + "\n";
    }
    words.shared.finish(json, text);
}

void runInfo(const InfoWords& words) {
    const auto limit = words.shared.begin();
    const std::filesystem::path path = words.path;
    if (!std::filesystem::exists(path))
        throw IoError(words.path, "nothing", "a model (.vdb) or a data set", "check the path");
    const bool is_data = std::filesystem::is_directory(path) || path.extension() == ".json";
    if (is_data)
        describeDataset(words);
    else
        describeModel(words);
}

}  // namespace

Command addInfo(CLI::App& program) {
    auto words = std::make_shared<InfoWords>();
    CLI::App& app = *program.add_subcommand("info", "Tell what a model or a data set holds");
    app.add_option("PATH", words->path, "A model, or a data set as for train")->required();
    words->shared.add(app, "  nerfvdb info lego.vdb\n  nerfvdb info data/lego --json -");
    return {&app, [words] { runInfo(*words); }};
}

}  // namespace nerfvdb
