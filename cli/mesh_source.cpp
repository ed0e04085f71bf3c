// SPDX-License-Identifier: Apache-2.0
#include "cli/mesh_source.h"

#include <utility>

#include "cli/block_scene.h"
#include "core/error.h"
#include "export/block_fields.h"
#include "export/flat_model.h"
#include "export/moved_model.h"
#include "export/vertex_colours.h"
#include "vdb/model_file.h"

namespace nerfvdb {

MeshSource::MeshSource(const std::filesystem::path& path, const ShellWords& shells, const Vec3d& origin, Report& report)
    : origin_(origin) {
    if (!isBlockFolder(path)) {
        model_ = movedModel(shells.flatten(loadModel(path), report), origin_);
        return;
    }
    if (shells.isGiven())
        throw UsageError("--shells", "it together with a folder of blocks", "no --shells",
                         "of blocks the inner boxes are put together");
    folder_ = std::filesystem::is_directory(path) ? path : path.parent_path();
    index_ = readBlockIndex(path);
    std::vector<BlockDensity> densities;
    for (const BlockId& block : trainedBlocks(*index_, folder_)) {
        report.info("block " + blockName(block));
        densities.push_back(densityOfBlock(index_->grid, block, loadBlock(folder_, block)));
    }
    model_ = movedModel(joinBlocks(index_->grid, std::move(densities)), origin_);
}

void MeshSource::colour(Mesh& mesh, Report& report) const {
    if (!index_) return colourVertices(model_, mesh, report);
    const std::vector<BlockId> blocks = trainedBlocks(*index_, folder_);
    std::vector<std::vector<std::uint32_t>> own(blocks.size());  // [block] its vertices
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3d at = mesh.positions[v].cast<double>() + origin_;
        std::size_t best = 0;
        for (std::size_t b = 1; b < blocks.size(); ++b)
            if (index_->grid.weight(blocks[b], at) > index_->grid.weight(blocks[best], at)) best = b;
        own[best].push_back(static_cast<std::uint32_t>(v));
    }
    mesh.colours.resize(mesh.positions.size());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        if (own[b].empty()) continue;
        Mesh part;
        for (const std::uint32_t v : own[b]) part.positions.push_back(mesh.positions[v]);
        colourVertices(movedModel(flatModel(loadBlock(folder_, blocks[b]), 1), origin_), part, report);
        for (std::size_t i = 0; i < own[b].size(); ++i) mesh.colours[own[b][i]] = part.colours[i];
    }
}

}  // namespace nerfvdb
