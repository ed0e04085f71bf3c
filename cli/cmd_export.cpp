// SPDX-License-Identifier: Apache-2.0
// nerfvdb export: a model as a plain volume that Blender, Houdini and others show.
#include "cli/commands.h"
#include "cli/output_path.h"
#include "cli/process.h"
#include "core/error.h"
#include "export/vdb_export.h"
#include "vdb/model_file.h"

namespace nerfvdb {
namespace {

struct ExportWords {
    std::string model, out, color = "diffuse";
    double min_alpha = ExportVdbOptions{}.min_alpha;
    bool full_precision = false;
    SharedOptions shared;
};

void runExport(const ExportWords& words) {
    const auto limit = words.shared.begin();
    const std::filesystem::path out = words.out;
    if (out.extension() != ".vdb")
        throw UsageError("--out", "'" + words.out + "'", "a file name that ends in .vdb");
    prepareOutputFile("--out", out);
    if (std::filesystem::exists(out) && std::filesystem::equivalent(out, words.model))
        throw UsageError("--out", "the model itself", "another file",
                         "an export cannot be trained or rendered again");
    ExportVdbOptions options;
    options.color = words.color == "none" ? ExportVdbOptions::Color::none : ExportVdbOptions::Color::diffuse;
    options.min_alpha = words.min_alpha;
    options.half = !words.full_precision;

    const Model model = loadModel(words.model);
    const ExportVdbReport exported = exportVdb(model, out, options);

    const Json json = {{"command", "export"},
                       {"out", words.out},
                       {"active_voxels", exported.active_voxels},
                       {"left_out_voxels", exported.left_out},
                       {"lost_opacity", exported.lost_opacity},
                       {"voxel_size", model.field.frame().voxel_size},
                       {"half", exported.half},
                       {"file_bytes", exported.bytes},
                       {"peak_memory_bytes", peakMemoryBytes()},
                       {"lost", exported.lost}};
    std::string text =
        formatted("%s: %zu active voxels of %.4g world units, %s\n", words.out.c_str(), exported.active_voxels,
                  model.field.frame().voxel_size, sizeText(static_cast<double>(exported.bytes)).c_str());
    for (const std::string& line : exported.lost) text += "lost: " + line + "\n";
    words.shared.finish(json, text);
}

}  // namespace

Command addExport(CLI::App& program) {
    auto words = std::make_shared<ExportWords>();
    CLI::App& app =
        *program.add_subcommand("export", "Write a model as density and colour grids for other programs");
    app.add_option("MODEL", words->model, "A model that 'nerfvdb train' made")->required();
    app.add_option("--out", words->out, "The volume: grids 'density' (1 / world unit) and 'color' (linear RGB)")
        ->required()
        ->type_name("VOLUME.vdb");
    app.add_option("--color", words->color, "diffuse (the mean over all directions) or none [diffuse]")
        ->check(CLI::IsMember({"diffuse", "none"}))
        ->type_name("NAME");
    app.add_option("--min-alpha", words->min_alpha,
                   "Leave out voxels that stop less light than this share [0.001]")
        ->check(CLI::Range(0.0, 1.0))
        ->type_name("SHARE");
    app.add_flag("--full-precision", words->full_precision, "Write 32-bit numbers, not 16-bit");
    words->shared.add(app, "  nerfvdb export lego.vdb --out lego_volume.vdb");
    return {&app, [words] { runExport(*words); }};
}

}  // namespace nerfvdb
