// SPDX-License-Identifier: Apache-2.0
#include "vdb/occupancy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "core/parallel.h"
#include "vdb/leaf_cells.h"

namespace nerfvdb {
namespace {

/// Chebyshev distance to the nearest entry that is 0; two sweeps over half of the 26 neighbours
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

/// Distances of empty nodes, in nodes.
void fillNodeDistances(LeafTable& skip) {
    std::vector<std::int32_t> distance(skip.nodes.size(), skip.node_dims.maxCoeff() + 1);
    for (std::size_t node = 0; node < skip.nodes.size(); ++node)
        if (skip.nodes[node] >= 0) distance[node] = 0;
    fillDistances(skip.node_dims, distance);
    for (std::size_t node = 0; node < skip.nodes.size(); ++node)
        if (distance[node] > 0) skip.nodes[node] = -distance[node];
}

/// Distances of empty leaves in nodes that have others, in leaves, to at most a node's edge: which leaves are near
/// grows ring by ring, a node's 512 bits at a time. What is so near is never further than the next node, so that only
/// nodes with leaves and those around them take part.
void fillLeafDistances(LeafTable& skip) {
    struct Node {
        Vec3i place;
        std::int32_t number;   // in skip.leaves, or -1
        std::array<std::int32_t, 27> around;  // nodes here, or -1 for those that take no part
        LeafMask near;         // leaves at most so far from an occupied one
    };
    std::vector<Node> nodes;
    std::vector<std::int32_t> number(skip.nodes.size(), -1);  // in `nodes`
    for (int x = 0; x < skip.node_dims.x(); ++x)
        for (int y = 0; y < skip.node_dims.y(); ++y)
            for (int z = 0; z < skip.node_dims.z(); ++z) {
                const std::size_t index = skip.nodeIndex({x, y, z});
                if (skip.nodes[index] < -1) continue;
                number[index] = static_cast<std::int32_t>(nodes.size());
                nodes.push_back({{x, y, z}, std::max(skip.nodes[index], -1), {}, {}});
            }
    parallelRanges(nodes.size(), 16, [&](std::size_t first, std::size_t last) {
        for (std::size_t n = first; n < last; ++n) {
            Node& node = nodes[n];
            for (int i = 0; i < 27; ++i) {
                const Vec3i other = node.place + Vec3i(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1);
                const bool exists = (other.array() >= 0).all() && (other.array() < skip.node_dims.array()).all();
                node.around[i] = exists ? number[skip.nodeIndex(other)] : -1;
            }
            if (node.number < 0) continue;
            for (int leaf = 0; leaf < kNodeLeaves; ++leaf)
                if (skip.leaves[static_cast<std::size_t>(node.number) * kNodeLeaves + leaf] >= 0)
                    setBit(node.near, leaf);
        }
    });
    std::vector<LeafMask> grown(nodes.size());
    for (int distance = 1; distance <= kNodeDim; ++distance) {
        parallelRanges(nodes.size(), 16, [&](std::size_t first, std::size_t last) {
            for (std::size_t n = first; n < last; ++n) {
                std::array<const LeafMask*, 27> around;
                constexpr static LeafMask kNothing{};
                for (int i = 0; i < 27; ++i)
                    around[i] = nodes[n].around[i] >= 0 ? &nodes[nodes[n].around[i]].near : &kNothing;
                grown[n] = grownByOne(around);
                if (nodes[n].number < 0) continue;
                std::int32_t* const leaves = &skip.leaves[static_cast<std::size_t>(nodes[n].number) * kNodeLeaves];
                for (int word = 0; word < kLeafWords; ++word)
                    for (std::uint64_t bits = grown[n][word] & ~nodes[n].near[word]; bits; bits &= bits - 1)
                        leaves[word * 64 + std::countr_zero(bits)] = -distance;
                if (distance < kNodeDim) continue;
                for (int word = 0; word < kLeafWords; ++word)
                    for (std::uint64_t bits = ~grown[n][word]; bits; bits &= bits - 1)
                        leaves[word * 64 + std::countr_zero(bits)] = -(kNodeDim + 1);
            }
        });
        for (std::size_t n = 0; n < nodes.size(); ++n) nodes[n].near = grown[n];
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
    LeafTable& skip = occupancy.skip;
    skip = LeafTable(topology.dims() / kLeafDim, -1);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (!isEmpty(occupancy.cells[leaf])) skip.touch(topology.leafCoords()[leaf]) = static_cast<std::int32_t>(leaf);
    fillNodeDistances(skip);
    fillLeafDistances(skip);
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
    bricks.skip_nodes = occupancy.skip.nodes.data();
    bricks.skip_leaves = occupancy.skip.leaves.data();
    for (int axis = 0; axis < 3; ++axis) {
        bricks.node_dims[axis] = occupancy.skip.node_dims[axis];
        bricks.leaf_dims[axis] = occupancy.skip.dims[axis];
    }
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
