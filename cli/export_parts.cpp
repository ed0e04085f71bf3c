// SPDX-License-Identifier: Apache-2.0
#include "cli/export_parts.h"

#include <set>

#include "cli/block_scene.h"
#include "cli/text.h"
#include "core/error.h"
#include "export/block_fields.h"
#include "export/flat_model.h"

namespace nerfvdb {
namespace {

/// VOLUME.NAME.vdb
std::filesystem::path partPath(const std::filesystem::path& path, const std::string& name) {
    return path.parent_path() / (path.stem().string() + "." + name + path.extension().string());
}

/// Writes a part; false, with a warning, if nothing is left of it. Throws if `is_last` and no part was written.
bool exportPart(const Model& model, const std::filesystem::path& path, const ExportVdbOptions& options, const Json& id,
                bool is_last, std::vector<ExportPart>& parts, Report& report) {
    try {
        parts.push_back({id, exportVdb(model, path, options, report)});
        return true;
    } catch (const DataError& nothing) {
        if (parts.empty() && is_last) throw;
        report.warn(path.string() + " is left out: " + nothing.what());
        return false;
    }
}

}  // namespace

std::vector<ExportPart> exportShells(const Model& model, int n_shells, const std::filesystem::path& out,
                                     ExportVdbOptions options, Report& report) {
    options.max_blender_bytes /= n_shells;
    std::vector<ExportPart> parts;
    for (int shell = 0; shell < n_shells; ++shell) {
        if (shell > 0) options.outside = model.field.shellBox(shell - 1);
        report.info(formatted("shell %d of %d", shell, model.field.shells().count));
        const std::filesystem::path path = shell == 0 ? out : partPath(out, "shell" + std::to_string(shell));
        const bool is_last = shell + 1 == n_shells;
        if (exportPart(shellModel(model, shell), path, options, {{"shell", shell}}, is_last, parts, report) &&
            !options.placed_by)
            options.placed_by = parts.front().written.bounds;
    }
    return parts;
}

std::vector<ExportPart> exportBlocks(const std::filesystem::path& folder, const std::filesystem::path& out,
                                     ExportVdbOptions options, Report& report, std::vector<ModelCamera>& cameras) {
    const BlockIndex index = readBlockIndex(folder);
    const std::vector<BlockId> blocks = trainedBlocks(index, folder);
    options.max_blender_bytes /= static_cast<double>(blocks.size());
    options.placed_by = index.grid.region();
    std::set<std::string> names;
    std::vector<ExportPart> parts;
    for (const BlockId& block : blocks) {
        report.info("block " + blockName(block));
        const Model model = fadedBlock(index.grid, block, loadBlock(folder, block));
        exportPart(model, partPath(out, formatted("block%d_%d", block.i, block.j)), options, {{"block", {block.i, block.j}}},
                   block == blocks.back(), parts, report);
        for (const ModelCamera& camera : model.cameras)
            if (names.insert(camera.name).second) cameras.push_back(camera);
    }
    return parts;
}

}  // namespace nerfvdb
