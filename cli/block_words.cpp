// SPDX-License-Identifier: Apache-2.0
#include "cli/block_words.h"

#include <charconv>
#include <utility>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// Two whole numbers, not negative, with a character between them.
std::optional<std::pair<int, int>> twoNumbers(const std::string& text, char between) {
    int first = -1, second = -1;
    const char* const end = text.data() + text.size();
    const auto [middle, error] = std::from_chars(text.data(), end, first);
    if (error != std::errc() || middle == end || *middle != between) return std::nullopt;
    const auto [rest, other_error] = std::from_chars(middle + 1, end, second);
    if (other_error != std::errc() || rest != end || first < 0 || second < 0) return std::nullopt;
    return std::pair{first, second};
}

}  // namespace

BlockCount parseBlockCount(const std::string& where, const std::string& text) {
    const auto numbers = twoNumbers(text, 'x');
    const auto fits = [](int n) { return n >= 1 && n <= kMostBlocks; };
    if (!numbers || !fits(numbers->first) || !fits(numbers->second))
        throw UsageError(where, "'" + text + "'", "numbers of blocks along two axes, such as 3x2");
    return {numbers->first, numbers->second};
}

BlockId parseBlock(const std::string& where, const std::string& text) {
    const auto numbers = twoNumbers(text, ',');
    if (!numbers) throw UsageError(where, "'" + text + "'", "a block such as 0,1: column and row, from 0 on");
    return {numbers->first, numbers->second};
}

void BlockWords::add(CLI::App& command) {
    command
        .add_option("--blocks", blocks_,
                    "Cut a place too large for memory into NxM overlapping blocks along the ground, and train one after "
                    "another; --out is then a folder, which render, eval, export, mesh and info take as one scene; --time is "
                    "for all of them")
        ->type_name("NxM");
    command
        .add_option("--block", block_,
                    "Only this one of --blocks, column and row from 0 on: blocks need nothing of each other, and may be "
                    "trained by several machines")
        ->type_name("I,J");
}

std::optional<BlockId> BlockWords::only() const {
    if (block_.empty()) return std::nullopt;
    return parseBlock("--block", block_);
}

void BlockWords::check(const CLI::App& command) const {
    if (!block_.empty() && !isGiven())
        throw UsageError("--block", "no --blocks", "how many blocks there are", "add --blocks NxM");
    if (!isGiven()) return;
    if (command.count("--scene") > 0)
        throw UsageError("--blocks", "--scene too", "one of the two", "blocks are open scenes, each with a sky");
    if (command.count("--voxel-size") > 0)
        throw UsageError("--blocks", "--voxel-size too", "one of the two", "the number of blocks says how fine voxels are");
}

}  // namespace nerfvdb
