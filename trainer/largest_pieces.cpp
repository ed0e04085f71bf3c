// SPDX-License-Identifier: Apache-2.0
#include "trainer/largest_pieces.h"

#include <algorithm>
#include <cstdint>

namespace nerfvdb {
namespace {

struct Cell {
    std::int32_t leaf;
    std::int32_t offset;
};

/// The cell at `step` from a cell; leaf -1 where there is no leaf.
Cell neighbourOf(const Topology& topology, const Cell& cell, const Vec3i& step) {
    const Vec3i at = topology.leafCoords()[cell.leaf] * kLeafDim +
                     Vec3i(cell.offset >> 6, cell.offset >> 3 & 7, cell.offset & 7) + step;
    if ((at.array() < 0).any()) return {-1, 0};
    return {topology.findLeaf(at / kLeafDim), (at.x() & 7) << 6 | (at.y() & 7) << 3 | (at.z() & 7)};
}

/// Takes the piece that a cell is of out of `left`.
std::vector<Cell> takePiece(const Topology& topology, const Cell& first, std::vector<LeafMask>& left) {
    const auto take = [&](const Cell& cell) {
        std::uint64_t& word = left[cell.leaf][cell.offset / 64];
        const std::uint64_t bit = std::uint64_t{1} << cell.offset % 64;
        const bool is_left = (word & bit) != 0;
        word &= ~bit;
        return is_left;
    };
    std::vector<Cell> piece{first};
    take(first);
    for (std::size_t next = 0; next < piece.size(); ++next)
        for (int n = 0; n < 27; ++n) {
            const Vec3i step(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
            const Cell cell = neighbourOf(topology, piece[next], step);
            if (cell.leaf >= 0 && take(cell)) piece.push_back(cell);
        }
    return piece;
}

}  // namespace

std::vector<LeafMask> largestPieces(const Topology& topology, const std::vector<LeafMask>& cells, double share) {
    std::vector<std::vector<Cell>> pieces;
    std::vector<LeafMask> left = cells;
    std::size_t largest = 0;
    for (std::size_t leaf = 0; leaf < cells.size(); ++leaf)
        forEachBit(cells[leaf], [&](int offset) {
            if (!testBit(left[leaf], offset)) return;
            pieces.push_back(takePiece(topology, {static_cast<std::int32_t>(leaf), offset}, left));
            largest = std::max(largest, pieces.back().size());
        });
    std::vector<LeafMask> kept(cells.size());
    for (const std::vector<Cell>& piece : pieces) {
        if (static_cast<double>(piece.size()) < share * static_cast<double>(largest)) continue;
        for (const Cell& cell : piece) setBit(kept[cell.leaf], cell.offset);
    }
    return kept;
}

}  // namespace nerfvdb
