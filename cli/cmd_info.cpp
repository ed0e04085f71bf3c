// SPDX-License-Identifier: Apache-2.0
// nerfvdb info: what a model, a volume or a data set holds.
#include <algorithm>
#include <cmath>

#include "cli/block_info.h"
#include "cli/commands.h"
#include "cli/dataset_info.h"
#include "cli/foreign_vdb.h"
#include "cli/output_path.h"
#include "core/error.h"
#include "trainer/block_index.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct InfoWords {
    std::string path, plot;
    SharedOptions shared;
};

/// One shell of a field.
struct ShellFacts {
    double voxel_size = 0;  // world units
    Box box;
    std::size_t active_voxels = 0, cells = 0;
    std::vector<std::size_t> halved;  // of the active voxels, those half as wide, a quarter as wide, ...
};

std::vector<ShellFacts> shellFacts(const VoxelField& field) {
    std::vector<ShellFacts> facts(static_cast<std::size_t>(field.shells().count));
    for (int shell = 0; shell < field.shells().count; ++shell) {
        facts[shell].voxel_size = field.frame().voxel_size * Shells::scale(shell);
        facts[shell].box = field.shellBox(shell);
        facts[shell].halved.resize(static_cast<std::size_t>(field.shells().mostHalvings()));
    }
    const Topology& topology = field.topology();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const int layer = field.shells().layerAt(topology.leafCoords()[leaf].x() * kLeafDim);
        const int halvings = field.shells().halvingsOf(layer);
        ShellFacts& shell = facts[field.shells().shellOf(layer)];
        forEachBit(topology.voxels()[leaf], [&](int) {
            ++shell.active_voxels;
            if (halvings > 0) ++shell.halved[halvings - 1];
        });
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
                        {"halved", shell.halved},
                        {"cells", shell.cells}});
    return json;
}

/// Nothing for a scene in one box.
std::string shellsText(const std::vector<ShellFacts>& shells) {
    if (shells.size() == 1) return "";
    std::string text;
    for (std::size_t i = 0; i < shells.size(); ++i) {
        text += formatted("shell %zu: voxels of %.4g world units, %zu active, ", i, shells[i].voxel_size,
                          shells[i].active_voxels);
        for (std::size_t n = 0; n < shells[i].halved.size(); ++n)
            if (shells[i].halved[n] > 0) text += formatted("%zu of them 1/%d as wide, ", shells[i].halved[n], 2 << n);
        text += boxText(shells[i].box) + "\n";
    }
    return text;
}

void describeModel(const InfoWords& words) {
    const Model model = loadModel(words.path);
    const VoxelField& field = model.field;
    const Topology& topology = field.topology();
    const std::vector<ShellFacts> shells = shellFacts(field);
    const Vec3i dims = shells.size() > 1 ? field.shells().extent : topology.dims();  // of each shell
    const double in_box = dims.cast<double>().prod() * static_cast<double>(shells.size());
    double voxels = 0;  // as large as their shells'
    for (const ShellFacts& shell : shells) {
        voxels += static_cast<double>(shell.active_voxels);
        for (std::size_t n = 0; n < shell.halved.size(); ++n)
            voxels -= static_cast<double>(shell.halved[n]) * (1 - std::ldexp(1.0, -3 * static_cast<int>(n + 1)));
    }
    const double share = in_box > 0 ? voxels / in_box : 0;
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

/// Any other .vdb file: its grids, as they are.
void describeVolume(const InfoWords& words) {
    Json grids = Json::array();
    std::string text = "volume: " + words.path + "\n";
    tryForeignVdb(words.path);
    for (const GridFacts& grid : listGrids(words.path)) {
        grids.push_back({{"name", grid.name},
                         {"type", grid.type},
                         {"class", grid.grid_class},
                         {"active_voxels", grid.active_voxels},
                         {"dims", {grid.dims.x(), grid.dims.y(), grid.dims.z()}},
                         {"voxel_size", vectorJson(grid.voxel_size)},
                         {"bounds", boxJson(grid.bounds)}});
        const Vec3d& h = grid.voxel_size;
        const bool is_cube = (h.array() - h.x()).abs().maxCoeff() <= 1e-9 * std::abs(h.x());
        text += formatted("grid %s: %s, %s, %zu active voxels", grid.name.empty() ? "(no name)" : grid.name.c_str(),
                          grid.type.c_str(), grid.grid_class.c_str(), grid.active_voxels);
        text += is_cube ? formatted(" of %.4g world units\n", h.x())
                        : formatted(" of %.4g x %.4g x %.4g world units\n", h.x(), h.y(), h.z());
        if (grid.active_voxels > 0)
            text += formatted("    %d x %d x %d voxels, %s\n", grid.dims.x(), grid.dims.y(), grid.dims.z(),
                              boxText(grid.bounds).c_str());
    }
    if (grids.empty()) text += "no grids\n";
    const auto file_bytes = std::filesystem::file_size(words.path);
    text += "file: " + sizeText(static_cast<double>(file_bytes)) + "\n";
    words.shared.finish(
        {{"command", "info"}, {"kind", "volume"}, {"grids", grids}, {"file_bytes", file_bytes}}, text);
}

void runInfo(const InfoWords& words) {
    const auto limit = words.shared.begin();
    const std::filesystem::path path = words.path;
    if (!std::filesystem::exists(path))
        throw IoError(words.path, "nothing", "a model or volume (.vdb) or a data set", "check the path");
    const bool is_data = !isBlockFolder(path) && (std::filesystem::is_directory(path) || path.extension() == ".json");
    if (!words.plot.empty() && !is_data)
        throw UsageError("--plot", words.path + ", which is no data set", "a data set, whose cameras can be drawn");
    if (!words.plot.empty()) prepareOutputFile("--plot", words.plot);
    if (isBlockFolder(path)) {
        const Description description = describeBlocks(path);
        words.shared.finish(description.json, description.text);
    } else if (is_data) {
        const Description description = describeDataset(path, words.plot);
        words.shared.finish(description.json, description.text);
    } else if (isVdbFile(path) && !isModelFile(path)) {
        describeVolume(words);
    } else {
        describeModel(words);
    }
}

}  // namespace

Command addInfo(CLI::App& program) {
    auto words = std::make_shared<InfoWords>();
    CLI::App& app = *program.add_subcommand("info", "Tell what a model, a volume or a data set holds");
    app.add_option("PATH", words->path, "A model, a folder of blocks, any .vdb volume, or a data set as for train")->required();
    app.add_option("--plot", words->plot,
                   "Draw the cameras of a data set from above and from the side, held-out ones in another colour, with "
                   "the box that training would take")
        ->type_name("FILE.svg");
    words->shared.add(app, "  nerfvdb info lego.vdb\n  nerfvdb info data/lego --plot cameras.svg --json -");
    return {&app, [words] { runInfo(*words); }};
}

}  // namespace nerfvdb
