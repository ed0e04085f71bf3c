// SPDX-License-Identifier: Apache-2.0
// A number for every leaf coordinate of a box, in memory that grows with what exists and not with the box: leaves come
// in nodes of 8^3, and a node in which there is nothing has one number for all of them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

inline constexpr int kNodeDim = 8;       // leaves along a node's edge
inline constexpr int kNodeLeaves = 512;  // leaves in a node

struct LeafTable {
    Vec3i dims = Vec3i::Zero();        // leaves per axis
    Vec3i node_dims = Vec3i::Zero();   // nodes per axis
    std::vector<std::int32_t> nodes;   // [x][y][z] by node: where its leaves stand, in units of 512; negative: for all
    std::vector<std::int32_t> leaves;  // [node][512], offset x * 64 + y * 8 + z

    LeafTable() = default;
    /// `nothing` (negative) everywhere.
    LeafTable(const Vec3i& leaf_dims, std::int32_t nothing)
        : dims(leaf_dims), node_dims((leaf_dims + Vec3i::Constant(kNodeDim - 1)) / kNodeDim),
          nodes(static_cast<std::size_t>(node_dims.x()) * node_dims.y() * node_dims.z(), nothing) {}

    bool contains(const Vec3i& leaf) const { return (leaf.array() >= 0).all() && (leaf.array() < dims.array()).all(); }
    std::size_t nodeIndex(const Vec3i& node) const {
        return (static_cast<std::size_t>(node.x()) * node_dims.y() + node.y()) * node_dims.z() + node.z();
    }
    static std::size_t leafOffset(const Vec3i& leaf) {
        return static_cast<std::size_t>((leaf.x() & 7) * 64 + (leaf.y() & 7) * 8 + (leaf.z() & 7));
    }
    /// The number of a leaf, or its node's. The leaf must lie in the box.
    std::int32_t at(const Vec3i& leaf) const {
        const std::int32_t node = nodes[nodeIndex(leaf / kNodeDim)];
        return node < 0 ? node : leaves[static_cast<std::size_t>(node) * kNodeLeaves + leafOffset(leaf)];
    }
    /// The number of a leaf, to be set; its node comes to exist, its other leaves with what stood for all of them.
    std::int32_t& touch(const Vec3i& leaf) {
        std::int32_t& node = nodes[nodeIndex(leaf / kNodeDim)];
        if (node < 0) {
            const std::int32_t nothing = node;
            node = static_cast<std::int32_t>(leaves.size() / kNodeLeaves);
            leaves.resize(leaves.size() + kNodeLeaves, nothing);
        }
        return leaves[static_cast<std::size_t>(node) * kNodeLeaves + leafOffset(leaf)];
    }
    std::size_t bytes() const { return (nodes.size() + leaves.size()) * sizeof(std::int32_t); }
};

}  // namespace nerfvdb
