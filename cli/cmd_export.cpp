// SPDX-License-Identifier: Apache-2.0
// nerfvdb export: a model as a plain volume that Blender, Houdini and others show.
#include <algorithm>

#include "cli/commands.h"
#include "cli/export_parts.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "cli/quantities.h"
#include "cli/shell_words.h"
#include "core/error.h"
#include "export/blender_memory.h"
#include "export/camera_export.h"
#include "export/level_set.h"
#include "export/marching_cubes.h"
#include "export/unseen_solid.h"
#include "export/vdb_export.h"
#include "trainer/block_index.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

using Color = ExportVdbOptions::Color;
using Origin = PlacementOptions::Origin;

struct ExportWords {
    std::string model, out, color = "diffuse", up, source_up = "z", blender_memory;
    std::vector<double> bounds;
    double min_alpha = -1;
    int finer = 0;
    bool full_precision = false, center = false, ground = false, volume_only = false, level_set = false;
    bool each_shell = false;
    ShellWords shells;
    ExportVdbOptions options;
    SharedOptions shared;
};

UpAxis upAxis(const std::string& name) { return name == "y" ? UpAxis::y : UpAxis::z; }

/// What is left for the volume.
double blenderLimit(const std::string& size) {
    const double bytes = static_cast<double>(parseSize("--blender-memory", size)) - kBlenderItself;
    if (!(bytes > 0))
        throw UsageError("--blender-memory", "'" + size + "'", "more than the 300 MB that Blender itself needs");
    return bytes;
}

ExportVdbOptions exportOptions(const ExportWords& words) {
    ExportVdbOptions options = words.options;
    options.color = words.color == "none" ? Color::none : words.color == "mean" ? Color::mean : Color::diffuse;
    if (words.finer > 0) options.finer = words.finer;
    if (words.min_alpha >= 0) options.min_alpha = words.min_alpha;
    if (!words.bounds.empty()) options.bounds = parseBounds("--bounds", words.bounds);
    if (!words.blender_memory.empty())
        options.max_blender_bytes = blenderLimit(words.blender_memory);
    options.half = !words.full_precision;
    options.placement.source_up = upAxis(words.source_up);
    if (!words.up.empty()) options.placement.up = upAxis(words.up);
    if (words.center && words.ground)
        throw UsageError("--center", "it together with --ground", "one of the two");
    options.placement.origin = words.center ? Origin::middle : words.ground ? Origin::ground : Origin::keep;
    return options;
}

/// The files that lie beside the volumes.
struct Outputs {
    std::filesystem::path level_set, cameras, script;
};

Outputs checkOutputs(const ExportWords& words) {
    const std::filesystem::path out = words.out;
    if (out.extension() != ".vdb")
        throw UsageError("--out", "'" + words.out + "'", "a file name that ends in .vdb");
    if (words.each_shell && words.level_set)
        throw UsageError("--level-set", "it together with --each-shell", "one of the two",
                         "surfaces of shells alone would have walls between them");
    if (isBlockFolder(words.model) && (words.each_shell || words.level_set || words.shells.isGiven() || words.options.tiles > 1))
        throw UsageError("export", "a folder of blocks with --shells, --each-shell, --level-set or --tiles", "none of them",
                         "each block leaves as a file of its own");
    Outputs outputs{out, out, out};
    outputs.level_set.replace_extension(".surface.vdb");
    outputs.cameras.replace_extension(".cameras.json");
    outputs.script.replace_extension(".blender.py");
    std::vector<std::filesystem::path> paths = exportPaths(out, words.options.tiles);
    if (words.level_set) paths.push_back(outputs.level_set);
    if (!words.volume_only) paths.insert(paths.end(), {outputs.cameras, outputs.script});
    for (const std::filesystem::path& path : paths) {
        prepareOutputFile("--out", path);
        if (std::filesystem::exists(path) && std::filesystem::equivalent(path, words.model))
            throw UsageError("--out", "the model itself", "another file", "an export cannot be trained again");
    }
    return outputs;
}

void writeBeside(const Outputs& outputs, const std::vector<ModelCamera>& cameras, const ExportVdbOptions& options,
                 const std::vector<ExportPart>& parts) {
    BlenderScene scene;
    for (const ExportPart& part : parts)
        for (const ExportVdbReport::File& file : part.written.files)
            scene.volumes.push_back(file.path.filename().string());
    if (!cameras.empty()) {
        writeCamerasJson(outputs.cameras, cameras, parts.front().written.placement);
        scene.cameras = outputs.cameras.filename().string();
    }
    scene.color_name = options.color == Color::none ? "" : options.color_name;
    scene.up = options.placement.up.value_or(options.placement.source_up);
    writeBlenderScript(outputs.script, scene);
}

/// The surface of the model, its bodies solid; within the volume's bounds, and no finer than it.
void writeSurface(const Outputs& outputs, Model& model, const ExportVdbOptions& volume, const ExportVdbReport& exported,
                  Report& report) {
    makeUnseenSolid(model, automaticIso(model.field), report);
    MeshOptions options;
    options.colours = false;
    options.fill_inside = true;
    options.bounds = volume.bounds;
    const Mesh mesh = extractSurface(model, options, report);
    writeLevelSet(outputs.level_set, mesh, model.field.frame().voxel_size / std::min(exported.finer, 1.0), exported.placement);
    report.info("level set: " + outputs.level_set.string());
}

Json exportJson(const ExportVdbReport& exported) {
    Json json = {{"files", Json::array()},
                 {"active_voxels", exported.active_voxels},
                 {"left_out_voxels", exported.left_out},
                 {"voxel_size", exported.voxel_size},
                 {"finer_than_model", exported.finer},
                 {"box_voxels", {exported.box_voxels.x(), exported.box_voxels.y(), exported.box_voxels.z()}},
                 {"blender_bytes", kBlenderItself + exported.blender_bytes},
                 {"half", exported.half},
                 {"file_bytes", exported.bytes}};
    for (const ExportVdbReport::File& file : exported.files)
        json["files"].push_back(
            {{"path", file.path.string()}, {"active_voxels", file.active_voxels}, {"bytes", file.bytes}});
    if (exported.loss)
        json["loss"] = {{"views", exported.loss->views},
                        {"psnr", exported.loss->psnr},
                        {"psnr_without_view_dependence", exported.loss->psnr_diffuse},
                        {"opacity_error", exported.loss->opacity_error}};
    return json;
}

/// As one volume, or a list of parts under `key`.
void addParts(Json& json, const char* key, const std::vector<ExportPart>& parts) {
    if (parts.front().id.empty()) return json.update(exportJson(parts.front().written));
    json[key] = Json::array();
    for (const ExportPart& part : parts) {
        json[key].push_back(part.id);
        json[key].back().update(exportJson(part.written));
    }
}

std::string exportText(const ExportWords& words, const ExportVdbOptions& options, const ExportVdbReport& exported) {
    const Vec3i& box = exported.box_voxels;
    std::string text;
    for (const ExportVdbReport::File& file : exported.files)
        text += formatted("%s: %zu active voxels of %.4g units, %s\n", file.path.string().c_str(), file.active_voxels,
                          exported.voxel_size, sizeText(static_cast<double>(file.bytes)).c_str());
    if (exported.finer > 1) text += formatted("voxels %.3g times finer than the model's\n", exported.finer);
    text += formatted("bounding box: %d x %d x %d voxels; Blender takes about %s for it\n", box.x(), box.y(), box.z(),
                      sizeText(kBlenderItself + exported.blender_bytes).c_str());
    if (exported.left_out > 0)
        text += formatted("left out: %zu voxels that %s\n", exported.left_out,
                          exported.has_view_colors ? "no camera of the training sees, or that stop no light"
                                                   : "stop next to no light");
    if (exported.loss)
        text += formatted("against the model, on %d views: PSNR %.2f dB (the model itself without view-dependence: "
                          "%.2f dB), opacity off by %.4f on average\n",
                          exported.loss->views, exported.loss->psnr, exported.loss->psnr_diffuse,
                          exported.loss->opacity_error);
    else if (options.color != Color::none)
        text += "not compared with the model: it names no cameras; 'nerfvdb eval " + words.out + " DATA' does\n";
    return text;
}

std::string partsText(const ExportWords& words, const ExportVdbOptions& options, const std::vector<ExportPart>& parts) {
    std::string text;
    for (const ExportPart& part : parts) text += exportText(words, options, part.written);
    if (options.color != Color::none)
        text += "colour is the same from all sides: reflections do not move with the eye\n";
    return text;
}

void runExport(const ExportWords& words) {
    const auto limit = words.shared.begin();
    const Outputs outputs = checkOutputs(words);
    const ExportVdbOptions options = exportOptions(words);
    TerminalReport report;
    Json json = {{"command", "export"}, {"out", words.out}};
    std::vector<ExportPart> parts;
    std::vector<ModelCamera> cameras;
    if (isBlockFolder(words.model)) {
        parts = exportBlocks(words.model, words.out, options, report, cameras);
        addParts(json, "each_block", parts);
    } else {
        const Model model = loadModel(words.model);
        cameras = model.cameras;
        const int available = model.field.shells().count;
        json["model_shells"] = available;
        if (words.each_shell) {
            parts = exportShells(model, words.shells.count(model, available), words.out, options, report);
        } else {
            Model flat = words.shells.flatten(model, report);
            parts.push_back({{}, exportVdb(flat, words.out, options, report)});
            if (words.level_set) writeSurface(outputs, flat, options, parts.front().written, report);
            json["shells"] = words.shells.count(model, 1);
        }
        addParts(json, "each_shell", parts);
    }
    if (!words.volume_only) writeBeside(outputs, cameras, options, parts);
    json["peak_memory_bytes"] = peakMemoryBytes();
    words.shared.finish(json, partsText(words, options, parts));
}

void addPlacement(CLI::App& app, ExportWords& words) {
    app.add_option("--scale", words.options.placement.scale,
                   "Length of a world unit in the file; density is divided by it [1]")
        ->check(positive())
        ->type_name("FACTOR");
    app.add_option("--up", words.up, "Turn the scene so that this axis points up: y (Houdini) or z (Blender) [as it is]")
        ->check(CLI::IsMember({"y", "z"}))
        ->type_name("AXIS");
    app.add_option("--source-up", words.source_up, "The axis that points up in the model: y or z [z]")
        ->check(CLI::IsMember({"y", "z"}))
        ->type_name("AXIS");
    app.add_flag("--center", words.center, "Put the middle of what is written into the origin");
    app.add_flag("--ground", words.ground, "Put the middle of its bottom there");
}

}  // namespace

Command addExport(CLI::App& program) {
    auto words = std::make_shared<ExportWords>();
    CLI::App& app =
        *program.add_subcommand("export", "Write a model as density and colour grids for other programs");
    app.add_option("MODEL", words->model, "A model or a folder of blocks that 'nerfvdb train' made")->required();
    app.add_option("--out", words->out,
                   "The volume: grids 'density' (1 / world unit) and 'color' (linear RGB). Beside it: the cameras, "
                   "VOLUME.cameras.json, and a script that shows it all in Blender, VOLUME.blender.py. Of blocks: their inner boxes "
                   "as VOLUME.block0_0.vdb, ..., which fade into each other")
        ->required()
        ->type_name("VOLUME.vdb");
    app.add_option("--color", words->color,
                   "diffuse (as the training views saw each voxel), mean (over all directions) or none [diffuse]")
        ->check(CLI::IsMember({"diffuse", "mean", "none"}))
        ->type_name("NAME");
    app.add_option("--color-name", words->options.color_name, "Name of the colour grid; Houdini wants Cd [color]")
        ->type_name("NAME");
    app.add_option("--fit", words->options.fit_steps,
                   "Steps in which density and colour are fitted to the model's pictures; 0: none [1000]")
        ->check(CLI::Range(0, 1000000))
        ->type_name("N");
    app.add_option("--min-alpha", words->min_alpha,
                   "Leave out voxels that stop less light than this share [1e-5, and what no camera sees]")
        ->check(CLI::Range(0.0, 1.0))
        ->type_name("SHARE");
    app.add_option("--finer", words->finer,
                   "Voxels N times finer than the model's: what is thinner than one keeps its shape [1, or up to 3 where "
                   "pictures would lose a decibel without]")
        ->check(CLI::Range(1, 4))
        ->type_name("N");
    app.add_option("--max-resolution", words->options.max_resolution,
                   "At most N voxels along the longest side [as the model]")
        ->check(positive())
        ->type_name("N");
    app.add_option("--max-voxels", words->options.max_voxels, "At most N active voxels [as the model]")
        ->check(positive())
        ->type_name("N");
    app.add_option("--blender-memory", words->blender_memory,
                   "Coarser, if need be, so that Blender holds it in so much, such as 4GB: it makes the bounding box dense")
        ->type_name("SIZE");
    app.add_option("--bounds", words->bounds, "Only what lies in this box, world units of the model [all]")
        ->expected(6)
        ->delimiter(',')
        ->type_name("X0,Y0,Z0,X1,Y1,Z1");
    app.add_option("--tiles", words->options.tiles,
                   "Cut into N files, VOLUME.000.vdb, ..., that line up exactly [1]")
        ->check(CLI::Range(1, 999))
        ->type_name("N");
    words->shells.add(app);
    app.add_flag("--each-shell", words->each_shell,
                 "Each shell as a file in its own voxels, VOLUME.vdb, VOLUME.shell1.vdb, ...; limits are for each [all of "
                 "them, or --shells]");
    addPlacement(app, *words);
    app.add_flag("--full-precision", words->full_precision, "Write 32-bit numbers, not 16-bit");
    app.add_flag("--level-set", words->level_set,
                 "Also the surface as signed distances, a narrow band: VOLUME.surface.vdb");
    app.add_flag("--volume-only", words->volume_only, "Write neither cameras nor the script for Blender");
    words->shared.add(app,
                      "  nerfvdb export lego.vdb --out lego_volume.vdb\n"
                      "  nerfvdb export lego.vdb --out houdini.vdb --up y --color-name Cd --max-resolution 300");
    return {&app, [words] { runExport(*words); }};
}

}  // namespace nerfvdb
