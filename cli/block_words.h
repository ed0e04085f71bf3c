// SPDX-License-Identifier: Apache-2.0
// --blocks and --block: a scene too large for memory, in parts.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "vdb/block_grid.h"

namespace nerfvdb {

/// "3x2" -> columns 3, rows 2. Throws UsageError.
struct BlockCount {
    int columns = 0, rows = 0;
};
BlockCount parseBlockCount(const std::string& where, const std::string& text);
/// "0,1" -> column 0, row 1. Throws UsageError.
BlockId parseBlock(const std::string& where, const std::string& text);

class BlockWords {
public:
    void add(CLI::App& command);
    bool isGiven() const { return !blocks_.empty(); }
    BlockCount count() const { return parseBlockCount("--blocks", blocks_); }
    /// The one block that is asked for; nothing: all.
    std::optional<BlockId> only() const;
    /// Throws UsageError where one is given without the other, or with an option that says what blocks are.
    void check(const CLI::App& command) const;

private:
    std::string blocks_, block_;
};

}  // namespace nerfvdb
