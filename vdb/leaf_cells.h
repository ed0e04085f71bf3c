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

}  // namespace nerfvdb
