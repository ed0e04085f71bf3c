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

/// All leaves, in their order, then the absent places below leaves into which the surface reaches, sorted.
std::vector<Block> listBlocks(const Surface& surface) {
    const Topology& topology = surface.field.topology();
    constexpr std::uint64_t kFirstY = 0xff, kFirstZ = 0x0101010101010101;
    std::vector<Vec3i> absent;
    std::vector<Block> blocks;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const Vec3i coord = topology.leafCoords()[leaf];
        blocks.emplace_back().leaf = coord;
        for (int corner = 1; corner < 8; ++corner) {
            const Vec3i step = cornerStep(corner);
            const std::uint64_t border = (step.y() ? kFirstY : ~0ull) & (step.z() ? kFirstZ : ~0ull);
            std::uint64_t bits = 0;
            for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x) bits |= surface.inside[leaf][x] & border;
            if (bits && topology.findLeaf(coord - step) < 0) absent.push_back(coord - step);
        }
    }
    std::sort(absent.begin(), absent.end(), [&](const Vec3i& a, const Vec3i& b) { return key(a) < key(b); });
    absent.erase(std::unique(absent.begin(), absent.end()), absent.end());
    for (const Vec3i& coord : absent) blocks.emplace_back().leaf = coord;
    return blocks;
}

void surveyBlock(const Surface& surface, Block& block) {
    const CornerRows rows(surface, block.leaf);
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
    BlockValues values(surface, block.leaf);
    forEachCrossedCell(rows, values, surface.iso, [&](int, int, int, const CubeTriangles& cube) {
        block.n_centres += cube.has_centre;
        block.n_triangles += cube.count;
    });
}

}  // namespace

BlockList::BlockList(const Surface& surface) : topology_(surface.field.topology()) {
    std::vector<Block> all = listBlocks(surface);
    parallelRanges(all.size(), kBlocksPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t b = begin; b < end; ++b) surveyBlock(surface, all[b]);
    });
    number_of_leaf_.assign(topology_.leafCount(), -1);
    for (std::size_t b = 0; b < all.size(); ++b) {
        if (all[b].isEmpty()) continue;
        if (b < number_of_leaf_.size()) {
            number_of_leaf_[b] = static_cast<std::int32_t>(blocks_.size());
            first_absent_ = blocks_.size() + 1;
        }
        blocks_.push_back(all[b]);
    }
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
