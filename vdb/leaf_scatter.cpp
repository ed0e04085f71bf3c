// SPDX-License-Identifier: Apache-2.0
#include "vdb/leaf_scatter.h"

#include <algorithm>

namespace nerfvdb {
namespace {

constexpr std::size_t kAhead = 8;  // entries whose samples are on their way from the cache below

/// Leaves per part; parts are ranges of leaf numbers, so neighbours in space share a part.
std::size_t leavesPerPart(const Topology& topology) {
    return std::max<std::size_t>(1, (topology.leafCount() + kScatterParts - 1) / kScatterParts);
}

}  // namespace

void TileGradients::bin(const Topology& topology) {
    const std::size_t per_part = leavesPerPart(topology);
    const std::int32_t* const upper = topology.upperNeighbours().data();
    std::array<std::uint32_t, kScatterParts + 1> count{};
    unsorted_.clear();
    samples.clear();
    for (int i = 0; i < kept.n; ++i) {
        const int cell = kept.cell[i];
        samples.push_back({cell, kept.ray[i], kept.x[i], kept.y[i], kept.z[i], kept.weight[i], kept.dl_draw[i]});
        const int crossed = (cell >> 6 == 7) * 4 + ((cell >> 3 & 7) == 7) * 2 + ((cell & 7) == 7);
        for (int corner = 0; corner < 8; ++corner) {
            if (corner & ~crossed) continue;
            const std::int32_t leaf = upper[static_cast<std::size_t>(kept.leaf[i]) * 8 + corner];
            unsorted_.push_back({leaf, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(corner)});
            ++count[static_cast<std::size_t>(leaf) / per_part + 1];
        }
    }
    for (int part = 0; part < kScatterParts; ++part) count[part + 1] += count[part];
    part_begin = count;
    touches.resize(unsorted_.size());
    for (const Touch& touch : unsorted_) touches[count[static_cast<std::size_t>(touch.leaf) / per_part]++] = touch;
}

void LeafScatter::run(const Topology& topology, int channels, std::span<const TileGradients> tiles,
                      const UseLeaf& use, float min_seen) {
    const std::size_t per_part = leavesPerPart(topology);
    parallelFor(kScatterParts, [&](std::size_t part) {
        Scratch& scratch = scratch_.local();
        if (scratch.features.size() < static_cast<std::size_t>(kLeafVoxels) * channels) {
            scratch.density = HugeArray<float>(kLeafVoxels);
            scratch.features = HugeArray<float>(static_cast<std::size_t>(kLeafVoxels) * channels);
        }

        // Sort the part's touches by leaf; counting keeps the order of tiles and samples.
        const std::size_t first_leaf = part * per_part;
        scratch.begin.assign(per_part + 1, 0);
        std::size_t n = 0;
        for (const TileGradients& tile : tiles)
            for (std::uint32_t i = tile.part_begin[part]; i < tile.part_begin[part + 1]; ++i, ++n)
                ++scratch.begin[static_cast<std::size_t>(tile.touches[i].leaf) - first_leaf + 1];
        if (n == 0) return;
        for (std::size_t leaf = 0; leaf < per_part; ++leaf) scratch.begin[leaf + 1] += scratch.begin[leaf];
        if (scratch.entries.size() < n) scratch.entries.resize(n + n / 2);
        for (std::uint32_t t = 0; t < tiles.size(); ++t)
            for (std::uint32_t i = tiles[t].part_begin[part]; i < tiles[t].part_begin[part + 1]; ++i) {
                const TileGradients::Touch& touch = tiles[t].touches[i];
                scratch.entries[scratch.begin[static_cast<std::size_t>(touch.leaf) - first_leaf]++] = {touch.leaf, t,
                                                                                                      touch};
            }

        const LeafGradient gradient{scratch.density.data(), scratch.features.data(), scratch.touched.data()};
        for (std::size_t begin = 0, end; begin < n; begin = end) {
            const std::int32_t leaf = scratch.entries[begin].leaf;
            scratch.contributions.clear();
            LeafMask seen{};
            for (end = begin; end < n && scratch.entries[end].leaf == leaf; ++end) {
                const Entry& entry = scratch.entries[end];
                if (end + kAhead < n) {
                    const Entry& later = scratch.entries[end + kAhead];
                    __builtin_prefetch(&tiles[later.tile].samples[later.touch.sample]);
                }
                const TileGradients& tile = tiles[entry.tile];
                const TileGradients::Sample& sample = tile.samples[entry.touch.sample];
                const int cell = sample.cell;
                const int corner = entry.touch.corner;
                scratch.contributions.push_back(
                    {(cell >> 6) - 8 * (corner >> 2 & 1), (cell >> 3 & 7) - 8 * (corner >> 1 & 1),
                     (cell & 7) - 8 * (corner & 1), sample.x, sample.y, sample.z, sample.weight, sample.dl_draw,
                     &tile.dl_dray_features[static_cast<std::size_t>(sample.ray) * channels]});
                if (corner == 0 && sample.weight >= min_seen) setBit(seen, cell);
            }
            simd::accumulateLeaf(static_cast<int>(scratch.contributions.size()), scratch.contributions.data(),
                                 channels, gradient);
            use(leaf, gradient, seen);
        }
    });
}

}  // namespace nerfvdb
