// SPDX-License-Identifier: Apache-2.0
// From voxels to the cells that have them for corners, 64 at a time.
#pragma once

#include <array>

#include "vdb/topology.h"

namespace nerfvdb {

/// Cells of a leaf of whose eight corners at least one is set. `voxels` [8]: the leaf's own mask and those of the
/// leaves at offset (n >> 2 & 1, n >> 1 & 1, n & 1).
inline LeafMask cellsWithCorner(const std::array<LeafMask, 8>& voxels) {
    constexpr std::uint64_t kFirstZ = 0x0101010101010101ull;  // bits with z == 0
    // Along each axis: bit p or bit p + 1, which for the last one lies in the next leaf.
    LeafMask z[4], y[2], cells;
    for (int n = 0; n < 4; ++n)
        for (int x = 0; x < kLeafWords; ++x) {
            const std::uint64_t here = voxels[2 * n][x], next = voxels[2 * n + 1][x];
            z[n][x] = here | (here >> 1 & ~(kFirstZ << 7)) | (next & kFirstZ) << 7;
        }
    for (int n = 0; n < 2; ++n)
        for (int x = 0; x < kLeafWords; ++x) y[n][x] = z[2 * n][x] | z[2 * n][x] >> 8 | z[2 * n + 1][x] << 56;
    for (int x = 0; x < kLeafWords; ++x) cells[x] = y[0][x] | (x + 1 < kLeafWords ? y[0][x + 1] : y[1][0]);
    return cells;
}

/// Bits set, or next to a set one across a face, an edge or a corner. `around` [27]: the mask itself (13) and those at
/// offset (n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1).
inline LeafMask grownByOne(const std::array<const LeafMask*, 27>& around) {
    constexpr std::uint64_t kFirstZ = 0x0101010101010101ull;
    // Along z, then y, then x; the outermost bits of a neighbour come in from its side.
    std::array<LeafMask, 9> z;
    for (int n = 0; n < 9; ++n)
        for (int x = 0; x < kLeafWords; ++x) {
            const std::uint64_t low = (*around[3 * n])[x], here = (*around[3 * n + 1])[x], high = (*around[3 * n + 2])[x];
            z[n][x] = here | (here & ~(kFirstZ << 7)) << 1 | (here & ~kFirstZ) >> 1 | (low >> 7 & kFirstZ) |
                      (high & kFirstZ) << 7;
        }
    std::array<LeafMask, 3> y;
    for (int n = 0; n < 3; ++n)
        for (int x = 0; x < kLeafWords; ++x) {
            const std::uint64_t low = z[3 * n][x], here = z[3 * n + 1][x], high = z[3 * n + 2][x];
            y[n][x] = here | here << 8 | here >> 8 | low >> 56 | high << 56;
        }
    LeafMask grown;
    for (int x = 0; x < kLeafWords; ++x)
        grown[x] = y[1][x] | (x > 0 ? y[1][x - 1] : y[0][kLeafWords - 1]) |
                   (x + 1 < kLeafWords ? y[1][x + 1] : y[2][0]);
    return grown;
}

}  // namespace nerfvdb
