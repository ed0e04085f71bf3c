// SPDX-License-Identifier: Apache-2.0
// A scene of blocks on disk: a folder with blocks.json, which says how the scene is cut, and a model for each block,
// block_I_J.vdb. Blocks know nothing of each other: any process that trains one writes the same blocks.json.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "vdb/block_grid.h"

namespace nerfvdb {

/// What blocks.json says.
struct BlockIndex {
    BlockGrid grid;
    std::vector<std::size_t> views;  // [block, as in grid.blocks()] that it learns from; too few: it has no model

    bool operator==(const BlockIndex&) const = default;
    bool isTrained(const BlockId& block) const;  // or is to be: has photographs enough
};

/// "0,1"
std::string blockName(const BlockId& block);
/// FOLDER/block_0_1.vdb
std::filesystem::path blockPath(const std::filesystem::path& folder, const BlockId& block);
/// True for a folder that has a blocks.json, and for such a file.
bool isBlockFolder(const std::filesystem::path& path);

/// Writes FOLDER/blocks.json, whole or not at all. If there is one that says something else, UsageError: blocks of two
/// ways to cut do not fit together.
void writeBlockIndex(const std::filesystem::path& folder, const BlockIndex& index);
/// Reads it, from the folder or the file. Throws IoError, or DataError naming file and field.
BlockIndex readBlockIndex(const std::filesystem::path& path);

}  // namespace nerfvdb
