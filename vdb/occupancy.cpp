// SPDX-License-Identifier: Apache-2.0
#include "vdb/occupancy.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/parallel.h"
#include "vdb/leaf_cells.h"

namespace nerfvdb {
namespace {

/// Chebyshev distance, in leaves, to the nearest leaf that is set; two sweeps over half of the 26 neighbours
/// are exact for this metric (Rosenfeld and Pfaltz 1968, "Distance functions on digital pictures").
void fillDistances(const Vec3i& dims, std::vector<std::int32_t>& distance) {
    const auto at = [&](int x, int y, int z) -> std::int32_t& {
        return distance[(static_cast<std::size_t>(x) * dims.y() + y) * dims.z() + z];
    };
    for (const int sign : {-1, 1}) {
        for (int i = 0; i < dims.x(); ++i)
            for (int j = 0; j < dims.y(); ++j)
                for (int k = 0; k < dims.z(); ++k) {
                    const int x = sign < 0 ? i : dims.x() - 1 - i, y = sign < 0 ? j : dims.y() - 1 - j,
                              z = sign < 0 ? k : dims.z() - 1 - k;
                    std::int32_t best = at(x, y, z);
                    if (best == 0) continue;
                    for (int n = 0; n < 13; ++n) {  // the half of the neighbours that this sweep has passed
                        const int a = x + sign * (1 - n / 9), b = y + sign * (1 - n / 3 % 3),
                                  c = z + sign * (1 - n % 3);
                        if (a < 0 || a >= dims.x() || b < 0 || b >= dims.y() || c < 0 || c >= dims.z()) continue;
                        best = std::min(best, at(a, b, c) + 1);
                    }
                    at(x, y, z) = best;
                }
    }
}

bool isEmpty(const LeafMask& mask) {
    return std::all_of(mask.begin(), mask.end(), [](std::uint64_t word) { return word == 0; });
}

}  // namespace

std::size_t Occupancy::cellCount() const {
    std::size_t n = 0;
    for (const LeafMask& mask : cells)
        for (const std::uint64_t word : mask) n += static_cast<std::size_t>(std::popcount(word));
    return n;
}

std::size_t Occupancy::leafCount() const {
    return static_cast<std::size_t>(
        std::count_if(cells.begin(), cells.end(), [](const LeafMask& mask) { return !isEmpty(mask); }));
}

Occupancy occupancyFromCells(const Topology& topology, std::vector<LeafMask> cells) {
    Occupancy occupancy;
    occupancy.cells = std::move(cells);
    occupancy.table_dims = topology.dims() / kLeafDim;
    const Vec3i& dims = occupancy.table_dims;
    const std::int32_t far = dims.maxCoeff() + 1;
    std::vector<std::int32_t>& table = occupancy.skip_table;
    table.assign(static_cast<std::size_t>(dims.x()) * dims.y() * dims.z(), far);
    const auto tableIndex = [&](const Vec3i& leaf) {
        return (static_cast<std::size_t>(leaf.x()) * dims.y() + leaf.y()) * dims.z() + leaf.z();
    };
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (!isEmpty(occupancy.cells[leaf])) table[tableIndex(topology.leafCoords()[leaf])] = 0;
    fillDistances(dims, table);
    for (std::int32_t& entry : table) entry = -entry;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (!isEmpty(occupancy.cells[leaf]))
            table[tableIndex(topology.leafCoords()[leaf])] = static_cast<std::int32_t>(leaf);
    return occupancy;
}

float rawFromVoxelAlpha(const VoxelField& field, float alpha) {
    const double tau = -std::log1p(-static_cast<double>(alpha));
    return static_cast<float>(std::log(std::max(tau, 1e-30) / (field.densityScale() * field.frame().voxel_size)));
}

Occupancy findOccupied(const VoxelField& field, float min_alpha) {
    const Topology& topology = field.topology();
    const float min_raw = rawFromVoxelAlpha(field, min_alpha);

    std::vector<LeafMask> dense(topology.leafCount());  // voxels at or above the threshold
    parallelRanges(topology.leafCount(), 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const float* const raw = &field.density()[leaf * kLeafVoxels];
            for (int word = 0; word < kLeafWords; ++word) {
                std::uint64_t bits = 0;
                for (int bit = 0; bit < 64; ++bit)
                    bits |= static_cast<std::uint64_t>(raw[word * 64 + bit] >= min_raw) << bit;
                dense[leaf][word] = bits & topology.voxels()[leaf][word];
            }
        }
    });

    std::vector<LeafMask> cells(topology.leafCount());
    parallelRanges(topology.leafCount(), 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const std::int32_t* const upper = &topology.upperNeighbours()[leaf * 8];
            // Where a neighbour is absent the leaf stands in for itself; the final mask removes what it adds.
            std::array<LeafMask, 8> voxels;
            for (int n = 0; n < 8; ++n) voxels[n] = dense[upper[n]];
            const LeafMask any = cellsWithCorner(voxels);
            for (int word = 0; word < kLeafWords; ++word) cells[leaf][word] = any[word] & topology.cells()[leaf][word];
        }
    });
    return occupancyFromCells(topology, std::move(cells));
}

Bricks bricksOf(const Topology& topology, const Occupancy& occupancy) {
    Bricks bricks;
    bricks.skip_table = occupancy.skip_table.data();
    for (int axis = 0; axis < 3; ++axis) bricks.table_dims[axis] = occupancy.table_dims[axis];
    bricks.upper_neighbours = topology.upperNeighbours().data();
    bricks.occupied = occupancy.cells.empty() ? nullptr : occupancy.cells.front().data();
    return bricks;
}

Bricks bricksOf(const VoxelField& field, const Occupancy& occupancy) {
    Bricks bricks = bricksOf(field.topology(), occupancy);
    bricks.density = field.density().data();
    bricks.features = field.features().data();
    bricks.channels = field.channels();
    return bricks;
}

}  // namespace nerfvdb
