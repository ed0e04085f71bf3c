// SPDX-License-Identifier: Apache-2.0
#include "cli/block_info.h"

#include "cli/text.h"
#include "trainer/block_index.h"

namespace nerfvdb {
namespace {

const char* stateOf(const BlockIndex& index, const std::filesystem::path& model, const BlockId& block) {
    if (!index.isTrained(block)) return "too few photographs";
    if (!std::filesystem::exists(model)) return "not trained";
    return std::filesystem::exists(std::filesystem::path(model).replace_extension(".ckpt")) ? "in training" : "trained";
}

}  // namespace

Description describeBlocks(const std::filesystem::path& path) {
    const std::filesystem::path folder = std::filesystem::is_directory(path) ? path : path.parent_path();
    const BlockIndex index = readBlockIndex(path);
    const BlockGrid& grid = index.grid;
    Description description;
    description.json = {{"command", "info"},
                        {"kind", "blocks"},
                        {"blocks", {grid.columns, grid.rows}},
                        {"up_axis", std::string(1, "xyz"[grid.up])},
                        {"bounds", boxJson(grid.region())},
                        {"models", Json::array()}};
    description.text =
        formatted("blocks: %d along %c, %d along %c\n", grid.columns, "xyz"[grid.axisOfColumns()], grid.rows,
                  "xyz"[grid.axisOfRows()]) +
        "bounds: " + boxText(grid.region()) + "\n";
    const std::vector<BlockId> blocks = grid.blocks();
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const std::filesystem::path model = blockPath(folder, blocks[b]);
        const char* const state = stateOf(index, model, blocks[b]);
        const std::uintmax_t bytes = std::filesystem::exists(model) ? std::filesystem::file_size(model) : 0;
        description.json["models"].push_back({{"block", {blocks[b].i, blocks[b].j}},
                                              {"file", model.filename().string()},
                                              {"views", index.views[b]},
                                              {"state", state},
                                              {"file_bytes", bytes},
                                              {"bounds", boxJson(grid.box(blocks[b]))}});
        description.text += formatted("block %s: %zu views, %s", blockName(blocks[b]).c_str(), index.views[b], state) +
                            (bytes > 0 ? ", " + sizeText(static_cast<double>(bytes)) : std::string()) + "\n";
    }
    return description;
}

}  // namespace nerfvdb
