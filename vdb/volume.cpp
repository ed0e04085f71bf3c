// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume.h"

#include <algorithm>
#include <string>
#include <unordered_map>

#include "core/error.h"
#include "core/parallel.h"
#include "vdb/leaf_cells.h"

namespace nerfvdb {
namespace {

// A leaf of the box takes four bytes in the topology and four in the occupancy: 2 GiB of tables.
constexpr double kMostLeavesInBox = 1 << 28;
constexpr std::size_t kMostLeaves = std::size_t{1} << 22;  // kernels number values, 512 a leaf, in 32 bits

Vec3i corner(int n) { return {n >> 2 & 1, n >> 1 & 1, n & 1}; }

/// Numbers the places of a box of leaves.
class LeafNumbers {
public:
    LeafNumbers(const Vec3i& first, const Vec3i& count) : first_(first), count_(count.cast<std::int64_t>()) {}
    std::int64_t operator()(const Vec3i& leaf) const {
        const Vec3i at = leaf - first_;
        return (at.x() * count_.y() + at.y()) * count_.z() + at.z();
    }

private:
    Vec3i first_;
    Eigen::Matrix<std::int64_t, 3, 1> count_;
};

}  // namespace

Volume::Volume(std::span<const Topology::LeafCells> active, const GridFrame& frame) {
    Vec3i low = Vec3i::Zero(), high = Vec3i::Zero();
    if (!active.empty()) low = high = active.front().leaf;
    for (const Topology::LeafCells& entry : active) {
        low = low.cwiseMin(entry.leaf);
        high = high.cwiseMax(entry.leaf);
    }
    // A cell below an active voxel may lie in the leaf before, its upper corners in the leaf behind.
    const Vec3i first = low - Vec3i::Ones(), count = high - low + Vec3i::Constant(3);
    if (count.cast<double>().prod() > kMostLeavesInBox)
        throw DataError("volume", "active voxels in a box of " + std::to_string(count.x()) + " x " +
                                      std::to_string(count.y()) + " x " + std::to_string(count.z()) + " leaves of 8^3",
                        "at most 2^28 leaves", "remove voxels far from the rest, or resample it coarser");

    const LeafNumbers number(first, count);
    std::unordered_map<std::int64_t, std::size_t> entry_at;
    std::vector<Vec3i> with_cells;
    for (std::size_t i = 0; i < active.size(); ++i) {
        entry_at.emplace(number(active[i].leaf), i);
        for (int n = 0; n < 8; ++n) with_cells.push_back(active[i].leaf - corner(n));
    }
    const auto before = [&](const Vec3i& a, const Vec3i& b) { return number(a) < number(b); };
    std::sort(with_cells.begin(), with_cells.end(), before);
    with_cells.erase(std::unique(with_cells.begin(), with_cells.end()), with_cells.end());

    std::vector<Topology::LeafCells> cells;
    for (const Vec3i& leaf : with_cells) {
        std::array<LeafMask, 8> voxels{};
        for (int n = 0; n < 8; ++n)
            if (const auto found = entry_at.find(number(leaf + corner(n))); found != entry_at.end())
                voxels[n] = active[found->second].cells;
        cells.push_back({leaf - first, cellsWithCorner(voxels)});
    }

    topology_ = Topology(count * kLeafDim, cells);
    if (topology_.leafCount() > kMostLeaves)
        throw DataError("volume", "voxels in " + std::to_string(topology_.leafCount()) + " leaves of 8^3",
                        "at most 2^22 leaves", "resample it coarser, or split it");
    first_voxel_ = first * kLeafDim;
    frame_ = {frame.worldFromIndex(first_voxel_.cast<double>()), frame.voxel_size};
    active_.resize(topology_.leafCount());
    for (std::size_t leaf = 0; leaf < topology_.leafCount(); ++leaf)
        if (const auto found = entry_at.find(number(topology_.leafCoords()[leaf] + first)); found != entry_at.end())
            active_[leaf] = active[found->second].cells;
    sigma_ = HugeArray<float>(topology_.leafCount() * kLeafVoxels);
    color_ = HugeArray<float>(topology_.leafCount() * kLeafVoxels * kChannels);
}

void Volume::place(const Similarity& new_from_world) {
    const double scale = new_from_world.scale;
    frame_ = {frame_.origin * scale, frame_.voxel_size * scale};
    world_from_grid_ = {1.0, new_from_world.rotation * world_from_grid_.rotation,
                        new_from_world.apply(world_from_grid_.translation)};
    if (world_from_grid_.rotation == Mat3d::Identity()) {
        frame_.origin += world_from_grid_.translation;
        world_from_grid_.translation.setZero();
    }
    if (scale == 1) return;
    for (float& sigma : sigma_.span()) sigma = static_cast<float>(sigma / scale);
}

Volume Volume::restricted(std::span<const LeafMask> keep) const {
    const Vec3i first_leaf = first_voxel_ / kLeafDim;
    std::vector<Topology::LeafCells> active;
    for (std::size_t leaf = 0; leaf < topology_.leafCount(); ++leaf) {
        LeafMask mask = active_[leaf];
        for (int word = 0; word < kLeafWords; ++word) mask[word] &= keep[leaf][word];
        if (mask != LeafMask{}) active.push_back({topology_.leafCoords()[leaf] + first_leaf, mask});
    }
    Volume result(active, givenFrame());
    result.world_from_grid_ = world_from_grid_;
    parallelFor(result.topology_.leafCount(), [&](std::size_t leaf) {
        const Vec3i coord = result.topology_.leafCoords()[leaf] + result.first_voxel_ / kLeafDim - first_leaf;
        const int from = topology_.findLeaf(coord);
        if (from < 0) return;
        forEachBit(result.topology_.voxels()[leaf], [&](int offset) {
            const std::size_t to_voxel = leaf * kLeafVoxels + offset;
            const std::size_t from_voxel = static_cast<std::size_t>(from) * kLeafVoxels + offset;
            if (testBit(result.active_[leaf], offset)) result.sigma_[to_voxel] = sigma_[from_voxel];
            std::copy_n(&color_[from_voxel * kChannels], kChannels, &result.color_[to_voxel * kChannels]);
        });
    });
    return result;
}

Occupancy allCells(const Volume& volume) {
    const std::span<const LeafMask> cells = volume.topology().cells();
    return occupancyFromCells(volume.topology(), std::vector<LeafMask>(cells.begin(), cells.end()));
}

}  // namespace nerfvdb
