// SPDX-License-Identifier: Apache-2.0
#include "vdb/topology.h"

#include <bit>
#include <string>

#include "core/error.h"
#include "vdb/topology_tree.h"

namespace nerfvdb {
namespace {

constexpr std::uint64_t kFirstZ = 0x0101010101010101ull;  // bits with z == 0 in every row of y

/// One step of growth along an axis: what a leaf's bits become inside the leaf, and what crosses into the next.
struct Shifted {
    LeafMask inside{};
    LeafMask carry{};
};

/// Moves every bit by +1 along `axis` (0: x, 1: y, 2: z).
Shifted shiftUp(const LeafMask& mask, int axis) {
    Shifted out;
    for (int x = 0; x < kLeafWords; ++x) {
        const std::uint64_t word = mask[x];
        if (axis == 0) {
            if (x + 1 < kLeafWords) out.inside[x + 1] = word;
            else out.carry[0] = word;
        } else if (axis == 1) {
            out.inside[x] = word << 8;
            out.carry[x] = word >> 56;
        } else {
            out.inside[x] = (word & ~(kFirstZ << 7)) << 1;
            out.carry[x] = word >> 7 & kFirstZ;
        }
    }
    return out;
}

bool isEmpty(const LeafMask& mask) {
    for (const std::uint64_t word : mask)
        if (word) return false;
    return true;
}

std::size_t countBits(std::span<const LeafMask> masks) {
    std::size_t n = 0;
    for (const LeafMask& mask : masks)
        for (const std::uint64_t word : mask) n += static_cast<std::size_t>(std::popcount(word));
    return n;
}

/// A table of nodes is dense (leaf_table.h): a box of any size, with next to nothing in it, would be any memory.
Vec3i checkedLeafDims(const Vec3i& dims) {
    constexpr double kMostNodes = 1 << 24;  // of 64^3 voxels: a cube of 16384
    if ((dims.array() < kLeafDim).any() || (dims.array() - dims.array() / kLeafDim * kLeafDim != 0).any())
        throw UsageError("topology: every dimension must be a positive multiple of 8 voxels");
    if ((dims.cast<double>() / (kLeafDim * kNodeDim)).array().ceil().prod() > kMostNodes)
        throw DataError("topology", std::to_string(dims.x()) + " x " + std::to_string(dims.y()) + " x " +
                                        std::to_string(dims.z()) + " voxels",
                        "a box of at most 2^24 nodes of 64 x 64 x 64", "resample it coarser, or cut it");
    return dims / kLeafDim;
}

using MaskLeaf = openvdb::MaskTree::LeafNodeType;

void addBits(openvdb::MaskTree& tree, const openvdb::Coord& origin, const LeafMask& mask) {
    MaskLeaf* leaf = tree.touchLeaf(origin);
    leaf->setValueMask(leaf->getValueMask() | nodeMask(mask));
}

/// Adds to every active value its neighbour at +1 along `axis`.
void growUp(openvdb::MaskTree& tree, int axis) {
    std::vector<std::pair<openvdb::Coord, LeafMask>> before;
    before.reserve(tree.leafCount());
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
        before.emplace_back(leaf->origin(), leafMask(leaf->getValueMask()));
    for (const auto& [origin, mask] : before) {
        const Shifted shifted = shiftUp(mask, axis);
        addBits(tree, origin, shifted.inside);
        openvdb::Coord next = origin;
        next[axis] += kLeafDim;
        if (!isEmpty(shifted.carry)) addBits(tree, next, shifted.carry);
    }
}

}  // namespace

Topology::Topology(const Vec3i& dims, std::span<const LeafCells> cells)
    : dims_(dims), table_(checkedLeafDims(dims), -1) {
    openvdb::MaskTree cell_tree;
    for (const LeafCells& entry : cells) {
        if (isEmpty(entry.cells)) continue;
        if (!table_.contains(entry.leaf))
            throw UsageError("topology: a cell lies outside the box");
        addBits(cell_tree, leafOrigin(entry.leaf), entry.cells);
    }

    openvdb::MaskTree voxel_tree(cell_tree);
    for (int axis = 0; axis < 3; ++axis) growUp(voxel_tree, axis);

    const std::size_t n_leaves = voxel_tree.leafCount();
    leaf_coords_.reserve(n_leaves);
    voxels_.reserve(n_leaves);
    cells_.reserve(n_leaves);
    for (auto leaf = voxel_tree.cbeginLeaf(); leaf; ++leaf) {
        const openvdb::Coord origin = leaf->origin();
        const Vec3i coord(origin.x() / kLeafDim, origin.y() / kLeafDim, origin.z() / kLeafDim);
        if (!table_.contains(coord))
            throw UsageError("topology: a cell touches the upper border of the box; cells end one voxel before it");
        table_.touch(coord) = static_cast<std::int32_t>(leaf_coords_.size());
        leaf_coords_.push_back(coord);
        voxels_.push_back(leafMask(leaf->getValueMask()));
        const MaskLeaf* cell_leaf = cell_tree.probeConstLeaf(origin);
        cells_.push_back(cell_leaf ? leafMask(cell_leaf->getValueMask()) : LeafMask{});
    }

    upper_neighbours_.resize(n_leaves * 8);
    for (std::size_t leaf = 0; leaf < n_leaves; ++leaf)
        for (int corner = 0; corner < 8; ++corner) {
            const int found = findLeaf(leaf_coords_[leaf] + Vec3i(corner >> 2 & 1, corner >> 1 & 1, corner & 1));
            upper_neighbours_[leaf * 8 + corner] = found >= 0 ? found : static_cast<std::int32_t>(leaf);
        }
}

int Topology::findLeaf(const Vec3i& leaf) const {
    return table_.contains(leaf) ? table_.at(leaf) : -1;
}

std::size_t Topology::cellCount() const { return countBits(cells_); }
std::size_t Topology::voxelCount() const { return countBits(voxels_); }

std::size_t Topology::bytes() const {
    return table_.bytes() +
           leaf_coords_.size() * (sizeof(Vec3i) + 2 * sizeof(LeafMask) + 8 * sizeof(std::int32_t));
}

openvdb::MaskTree voxelTree(const Topology& topology) {
    openvdb::MaskTree tree;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        addBits(tree, leafOrigin(topology.leafCoords()[leaf]), topology.voxels()[leaf]);
    return tree;
}

}  // namespace nerfvdb
