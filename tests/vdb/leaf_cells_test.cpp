// SPDX-License-Identifier: Apache-2.0
#include "vdb/leaf_cells.h"

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("a leaf's cells are those with a corner that is set, here or in the leaves behind") {
    for (std::uint64_t round = 0; round < 50; ++round) {
        std::array<LeafMask, 8> voxels{};
        for (std::uint64_t n = 0; n < 8; ++n)
            for (int k = 0; k < 12; ++k) setBit(voxels[n], static_cast<int>(randomBits(round, n, k) % kLeafVoxels));
        const LeafMask cells = cellsWithCorner(voxels);
        int wrong = 0, n_cells = 0;
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            bool expected = false;
            for (int corner = 0; corner < 8; ++corner) {
                const int x = (offset >> 6) + (corner >> 2 & 1), y = (offset >> 3 & 7) + (corner >> 1 & 1),
                          z = (offset & 7) + (corner & 1);
                const int leaf = (x >> 3) * 4 + (y >> 3) * 2 + (z >> 3);
                expected |= testBit(voxels[leaf], brickOffset(x & 7, y & 7, z & 7));
            }
            wrong += testBit(cells, offset) != expected;
            n_cells += expected;
        }
        CHECK(wrong == 0);
        CHECK(n_cells > 50);
    }
}

TEST_CASE("a grown mask has the bits next to set ones, across faces, edges, corners and into its neighbours") {
    for (std::uint64_t round = 0; round < 50; ++round) {
        std::array<LeafMask, 27> masks{};
        std::array<const LeafMask*, 27> around;
        for (std::uint64_t n = 0; n < 27; ++n) {
            around[n] = &masks[n];
            for (int k = 0; k < 6; ++k) setBit(masks[n], static_cast<int>(randomBits(round, 100 + n, k) % kLeafVoxels));
        }
        const LeafMask grown = grownByOne(around);
        int wrong = 0, n_grown = 0;
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            bool expected = false;
            for (int step = 0; step < 27; ++step) {
                // 8 more, so that divisions round down.
                const int x = 8 + (offset >> 6) + step / 9 - 1, y = 8 + (offset >> 3 & 7) + step / 3 % 3 - 1,
                          z = 8 + (offset & 7) + step % 3 - 1;
                expected |= testBit(masks[x / 8 * 9 + y / 8 * 3 + z / 8], brickOffset(x & 7, y & 7, z & 7));
            }
            wrong += testBit(grown, offset) != expected;
            n_grown += expected;
        }
        CHECK(wrong == 0);
        CHECK(n_grown > 50);
    }
}
