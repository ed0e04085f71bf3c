// SPDX-License-Identifier: Apache-2.0
#include "trainer/largest_pieces.h"

#include <vector>

#include "tests/support/catch.h"

namespace nerfvdb {
namespace {

/// A box of 3x3x3 leaves, all of whose cells exist.
Topology fullTopology() {
    std::vector<Topology::LeafCells> leaves;
    for (int n = 0; n < 27; ++n) {
        Topology::LeafCells entry{Vec3i(n / 9, n / 3 % 3, n % 3), {}};
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i cell = entry.leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if (cell.maxCoeff() < 23) setBit(entry.cells, offset);
        }
        leaves.push_back(entry);
    }
    return Topology(Vec3i::Constant(24), leaves);
}

void add(const Topology& topology, const Vec3i& cell, std::vector<LeafMask>& cells) {
    const Vec3i local = cell - cell / kLeafDim * kLeafDim;
    setBit(cells[topology.findLeaf(cell / kLeafDim)], local.x() << 6 | local.y() << 3 | local.z());
}

}  // namespace

TEST_CASE("pieces hang together across corners and leaves; crumbs go, and pieces large enough stay") {
    const Topology topology = fullTopology();
    std::vector<LeafMask> diagonal(topology.leafCount()), lump = diagonal, crumb = diagonal;
    for (int i = 0; i < 20; ++i) add(topology, Vec3i(i, i, 22 - i), diagonal);  // touches by corners, through five leaves
    for (int i = 0; i < 5; ++i) add(topology, Vec3i(20, i, 0), lump);
    add(topology, Vec3i(0, 22, 22), crumb);
    std::vector<LeafMask> all = diagonal, two = diagonal;
    for (std::size_t leaf = 0; leaf < all.size(); ++leaf)
        for (int word = 0; word < kLeafWords; ++word) {
            two[leaf][word] |= lump[leaf][word];
            all[leaf][word] |= lump[leaf][word] | crumb[leaf][word];
        }
    CHECK(largestPieces(topology, all, 0) == all);
    CHECK(largestPieces(topology, all, 0.25) == two);
    CHECK(largestPieces(topology, all, 0.26) == diagonal);
    CHECK(largestPieces(topology, all, 1) == diagonal);
    const std::vector<LeafMask> none(topology.leafCount());
    CHECK(largestPieces(topology, none, 0.5) == none);
}

}  // namespace nerfvdb
