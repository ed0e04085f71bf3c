// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_index.h"

#include "core/atomic_file.h"
#include "core/error.h"
#include "trainer/block_plan.h"
#include "trainer/json_node.h"

namespace nerfvdb {
namespace {

constexpr const char* kFileName = "blocks.json";
constexpr const char* kFormat = "nerfvdb-blocks";
constexpr int kVersion = 1;

std::filesystem::path indexPath(const std::filesystem::path& path) {
    return path.filename() == kFileName ? path : path / kFileName;
}

nlohmann::ordered_json vectorJson(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

Vec3d vectorOf(const JsonNode& node) {
    if (node.arraySize() != 3) node.fail(std::to_string(node.arraySize()) + " numbers", "three");
    return {node.element(0).number(), node.element(1).number(), node.element(2).number()};
}

BlockGrid gridOf(const JsonNode& document) {
    BlockGrid grid;
    grid.origin = vectorOf(document.at("origin"));
    grid.voxel_size = document.at("coarsest_voxel_size").positiveNumber();
    const JsonNode core = document.at("core_voxels"), blocks = document.at("blocks");
    for (int axis = 0; axis < 3; ++axis) {
        grid.core[axis] = core.element(static_cast<std::size_t>(axis)).wholeNumber(8, BlockGrid::kResolution);
        if (grid.core[axis] % 8 != 0)
            core.fail(std::to_string(grid.core[axis]) + " voxels", "multiples of 8");
    }
    grid.columns = blocks.element(0).wholeNumber(1, kMostBlocks);
    grid.rows = blocks.element(1).wholeNumber(1, kMostBlocks);
    grid.up = document.at("up_axis").wholeNumber(0, 2);
    return grid;
}

}  // namespace

bool BlockIndex::isTrained(const BlockId& block) const {
    return views[static_cast<std::size_t>(block.i) * static_cast<std::size_t>(grid.rows) +
                 static_cast<std::size_t>(block.j)] >= kFewestBlockViews;
}

std::string blockName(const BlockId& block) { return std::to_string(block.i) + "," + std::to_string(block.j); }

std::filesystem::path blockPath(const std::filesystem::path& folder, const BlockId& block) {
    return folder / ("block_" + std::to_string(block.i) + "_" + std::to_string(block.j) + ".vdb");
}

bool isBlockFolder(const std::filesystem::path& path) { return std::filesystem::is_regular_file(indexPath(path)); }

void writeBlockIndex(const std::filesystem::path& folder, const BlockIndex& index) {
    if (isBlockFolder(folder)) {
        if (readBlockIndex(folder) == index) return;
        throw UsageError(indexPath(folder).string(), "a scene that is cut in another way, or from other photographs",
                         "the blocks that --blocks asks for", "name another folder, or remove this one");
    }
    const BlockGrid& grid = index.grid;
    nlohmann::ordered_json json = {{"format", kFormat},
                                   {"version", kVersion},
                                   {"blocks", {grid.columns, grid.rows}},
                                   {"up_axis", grid.up},
                                   {"origin", vectorJson(grid.origin)},
                                   {"coarsest_voxel_size", grid.voxel_size},
                                   {"core_voxels", {grid.core.x(), grid.core.y(), grid.core.z()}},
                                   {"models", nlohmann::ordered_json::array()}};
    const std::vector<BlockId> blocks = grid.blocks();
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const Box box = grid.box(blocks[b]);
        json["models"].push_back({{"file", blockPath({}, blocks[b]).string()},
                                  {"views", index.views[b]},
                                  {"bounds", {vectorJson(box.min), vectorJson(box.max)}}});
    }
    writeAtomically(indexPath(folder), json.dump(1) + "\n");
}

BlockIndex readBlockIndex(const std::filesystem::path& path) {
    const std::filesystem::path file = indexPath(path);
    const nlohmann::json parsed = parseJsonFile(file);
    const JsonNode document(parsed, file);
    if (document.at("format").text() != kFormat)
        document.at("format").fail("'" + document.at("format").text() + "'", std::string("'") + kFormat + "'");
    if (const double version = document.at("version").number(); version != kVersion)
        document.at("version").fail(std::to_string(version), std::to_string(kVersion), "use the program that wrote it");
    BlockIndex index;
    index.grid = gridOf(document);
    const JsonNode models = document.at("models");
    if (models.arraySize() != index.grid.blocks().size())
        models.fail(std::to_string(models.arraySize()) + " models", std::to_string(index.grid.blocks().size()));
    for (std::size_t b = 0; b < models.arraySize(); ++b)
        index.views.push_back(static_cast<std::size_t>(models.element(b).at("views").wholeNumber(0, 1 << 30)));
    return index;
}

}  // namespace nerfvdb
