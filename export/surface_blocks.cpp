// SPDX-License-Identifier: Apache-2.0
#include "export/surface_blocks.h"

#include <algorithm>
#include <limits>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

/// Orders leaf coordinates.
std::array<int, 3> key(const Vec3i& leaf) { return {leaf.x(), leaf.y(), leaf.z()}; }

/// Adds the absent places below a leaf's place into which the surface around its voxels inside may reach.
void addPlacesBelow(const Topology& topology, const Vec3i& leaf, const LeafMask& inside,
                    std::vector<Vec3i>& absent) {
    constexpr std::uint64_t kFirstY = 0xff, kFirstZ = 0x0101010101010101;
    for (int corner = 1; corner < 8; ++corner) {
        const Vec3i step = cornerStep(corner);
        const std::uint64_t border = (step.y() ? kFirstY : ~0ull) & (step.z() ? kFirstZ : ~0ull);
        std::uint64_t bits = 0;
        for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x) bits |= inside[x] & border;
        if (bits && topology.findLeaf(leaf - step) < 0) absent.push_back(leaf - step);
    }
}

/// The enclosed places that the faces of the bounds run through or touch, and those below them: the surface
/// that closes there is far from any leaf.
void addCutPlaces(const Surface& surface, std::vector<Vec3i>& absent) {
    const Vec3i leaves = surface.field.topology().dims() / kLeafDim;
    Vec3i leaf;
    for (leaf.x() = 0; leaf.x() < leaves.x(); ++leaf.x())
        for (leaf.y() = 0; leaf.y() < leaves.y(); ++leaf.y())
            for (leaf.z() = 0; leaf.z() < leaves.z(); ++leaf.z()) {
                const Vec3i first = leaf * kLeafDim - Vec3i::Ones(),
                            last = leaf * kLeafDim + Vec3i::Constant(kLeafDim);
                if (!surface.enclosed.contains(leaf)) continue;
                if (surface.bounds.contains(first) && surface.bounds.contains(last)) continue;
                absent.push_back(leaf);
                addPlacesBelow(surface.field.topology(), leaf, surface.bounds.maskOf(leaf), absent);
            }
}

/// All leaves, in their order, then the absent places into which the surface reaches, sorted.
std::vector<Block> listBlocks(const Surface& surface) {
    const Topology& topology = surface.field.topology();
    std::vector<Vec3i> absent;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        addPlacesBelow(topology, topology.leafCoords()[leaf], surface.inside[leaf], absent);
    if (surface.is_filled) addCutPlaces(surface, absent);
    std::sort(absent.begin(), absent.end(), [&](const Vec3i& a, const Vec3i& b) { return key(a) < key(b); });
    absent.erase(std::unique(absent.begin(), absent.end()), absent.end());

    std::vector<Block> blocks;
    blocks.reserve(topology.leafCount() + absent.size());
    for (const Vec3i& coord : topology.leafCoords()) blocks.emplace_back().leaf = coord;
    for (const Vec3i& coord : absent) blocks.emplace_back().leaf = coord;
    return blocks;
}

void surveyBlock(const Surface& surface, Block& block) {
    const BlockCorners rows(surface, block.leaf);
    for (int x = 0; x < kLeafDim; ++x) {
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row = rows.row(x, y);
            const unsigned crossed[3] = {row ^ rows.row(x + 1, y), row ^ rows.row(x, y + 1), row ^ row >> 1};
            for (int axis = 0; axis < 3; ++axis)
                block.crossed[axis][x] |= std::uint64_t{crossed[axis] & 0xff} << (8 * y);
        }
        for (int axis = 0; axis < 3; ++axis) {
            block.rank[x][axis] = static_cast<std::uint16_t>(block.n_edges);
            block.n_edges += std::popcount(block.crossed[axis][x]);
        }
    }
    forEachCrossedCell(rows, surface.iso, [&](int, int, int, const CubeTriangles& cube) {
        block.n_centres += cube.has_centre;
        block.n_triangles += cube.count;
    });
}

}  // namespace

BlockList::BlockList(const Surface& surface)
    : topology_(surface.field.topology()), blocks_(listBlocks(surface)) {
    parallelRanges(blocks_.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) surveyBlock(surface, blocks_[b]);
    });
    number_of_leaf_.assign(topology_.leafCount(), -1);
    std::size_t n_kept = 0;  // moved in place: a second list would take as much memory again
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
        if (b == number_of_leaf_.size()) first_absent_ = n_kept;
        if (blocks_[b].isEmpty()) continue;
        if (b < number_of_leaf_.size()) number_of_leaf_[b] = static_cast<std::int32_t>(n_kept);
        blocks_[n_kept++] = blocks_[b];
    }
    if (blocks_.size() == number_of_leaf_.size()) first_absent_ = n_kept;
    blocks_.resize(n_kept);
    placeBlocks();
}

const Block* BlockList::find(const Vec3i& coord) const {
    if (const int leaf = topology_.findLeaf(coord); leaf >= 0)
        return number_of_leaf_[leaf] >= 0 ? &blocks_[number_of_leaf_[leaf]] : nullptr;
    const auto found =
        std::lower_bound(blocks_.begin() + first_absent_, blocks_.end(), coord,
                         [&](const Block& block, const Vec3i& c) { return key(block.leaf) < key(c); });
    return found != blocks_.end() && found->leaf == coord ? &*found : nullptr;
}

void BlockList::placeBlocks() {
    for (Block& block : blocks_) {
        block.first_vertex = static_cast<std::uint32_t>(n_vertices_);
        block.first_triangle = static_cast<std::uint32_t>(n_triangles_);
        n_vertices_ += block.n_edges + block.n_centres;
        n_triangles_ += block.n_triangles;
    }
    // Mesh files count in signed 32-bit numbers; twice as many triangles as vertices is normal.
    constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
    if (n_vertices_ > kMost || n_triangles_ > kMost)
        throw NumericError("mesh", std::to_string(n_triangles_) + " triangles",
                           "at most " + std::to_string(kMost),
                           "choose a higher iso or mesh a part of the scene");
}

}  // namespace nerfvdb
