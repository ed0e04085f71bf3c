// SPDX-License-Identifier: Apache-2.0
#include "vdb/leaf_scatter.h"

#include <bit>

namespace nerfvdb {
namespace {

/// Parts are ranges of leaf numbers, 2^shift each, so neighbours in space share a part.
int partShift(const Topology& topology) {
    const std::size_t per_part = (topology.leafCount() + kScatterParts - 1) / kScatterParts;
    return per_part > 1 ? std::bit_width(per_part - 1) : 0;
}

}  // namespace

void TileGradients::bin(const Topology& topology, int channels) {
    const int shift = partShift(topology);
    const std::int32_t* const upper = topology.upperNeighbours().data();
    const auto n = static_cast<std::size_t>(kept.n);
    if (samples.size() < n) samples.resize(n + n / 2);
    part_begin.fill(0);
    std::size_t n_touches = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const int cell = kept.cell[i];
        samples[i] = {cell,           kept.x[i],       kept.y[i],
                      kept.z[i],      kept.weight[i],  kept.dl_draw[i],
                      &dl_dray_features[static_cast<std::size_t>(kept.ray[i]) * channels]};
        if (unsorted_.size() < n_touches + 8) unsorted_.resize(n_touches + n_touches / 2 + n + 8);
        const unsigned crossed = (cell >> 6 == 7) * 4 + ((cell >> 3 & 7) == 7) * 2 + ((cell & 7) == 7);
        for (unsigned corner = crossed;; corner = (corner - 1) & crossed) {  // all subsets of its bits
            const std::int32_t leaf = upper[static_cast<std::size_t>(kept.leaf[i]) * 8 + corner];
            unsorted_[n_touches++] = {leaf, static_cast<std::uint32_t>(i), corner};
            ++part_begin[static_cast<std::size_t>(leaf >> shift) + 1];
            if (corner == 0) break;
        }
    }
    for (int part = 0; part < kScatterParts; ++part) part_begin[part + 1] += part_begin[part];
    std::array<std::uint32_t, kScatterParts + 1> next = part_begin;
    if (touches.size() < n_touches) touches.resize(n_touches + n_touches / 2);
    for (std::size_t i = 0; i < n_touches; ++i) touches[next[unsorted_[i].leaf >> shift]++] = unsorted_[i];
}

void LeafScatter::run(const Topology& topology, int channels, std::span<const TileGradients> tiles,
                      const UseLeaf& use, float min_seen, const ExpectLeaf& expect) {
    const int shift = partShift(topology);
    parallelFor(kScatterParts, [&](std::size_t part) {
        Scratch& scratch = scratch_.local();
        for (Summed& summed : scratch.summed) {
            summed.leaf = -1;  // whatever an exception left
            if (summed.features.size() < static_cast<std::size_t>(kLeafVoxels) * channels) {
                summed.density = HugeArray<float>(kLeafVoxels);
                summed.features = HugeArray<float>(static_cast<std::size_t>(kLeafVoxels) * channels);
            }
        }

        // Sort the part's touches by leaf; counting keeps the order of tiles and samples.
        const std::int32_t first_leaf = static_cast<std::int32_t>(part) << shift;
        scratch.begin.assign((std::size_t{1} << shift) + 1, 0);
        std::size_t n = 0;
        for (const TileGradients& tile : tiles)
            for (std::uint32_t i = tile.part_begin[part]; i < tile.part_begin[part + 1]; ++i, ++n)
                ++scratch.begin[static_cast<std::size_t>(tile.touches[i].leaf - first_leaf) + 1];
        if (n == 0) return;
        for (std::size_t leaf = 1; leaf < scratch.begin.size(); ++leaf) scratch.begin[leaf] += scratch.begin[leaf - 1];
        if (scratch.contributions.size() < n + kPadding) scratch.contributions.resize(n + n / 2 + kPadding);
        for (const TileGradients& tile : tiles)
            for (std::uint32_t i = tile.part_begin[part]; i < tile.part_begin[part + 1]; ++i) {
                const TileGradients::Touch touch = tile.touches[i];
                scratch.contributions[scratch.begin[static_cast<std::size_t>(touch.leaf - first_leaf)]++] = {
                    &tile.samples[touch.sample], touch.leaf, touch.corner};
            }

        const auto finish = [&](Summed& summed) {
            if (summed.leaf >= 0) use(summed.leaf, summed.gradient(), summed.seen);
            summed.leaf = -1;
        };
        int turn = 0;
        for (std::size_t begin = 0, end; begin < n; begin = end, turn ^= 1) {
            const std::int32_t leaf = scratch.contributions[begin].leaf;
            Summed& summed = scratch.summed[turn];
            summed.leaf = leaf;
            for (end = begin; end < n && scratch.contributions[end].leaf == leaf;) ++end;
            simd::accumulateLeaf(static_cast<int>(end - begin), &scratch.contributions[begin], channels,
                                 summed.gradient());
            if (expect) expect(leaf, summed.gradient());
            summed.seen = {};
            for (std::size_t i = begin; i < end; ++i) {
                const LeafContribution& contribution = scratch.contributions[i];
                if (contribution.corner == 0 && contribution.sample->weight >= min_seen)
                    setBit(summed.seen, contribution.sample->cell);
            }
            finish(scratch.summed[turn ^ 1]);
        }
        finish(scratch.summed[turn ^ 1]);
    });
}

}  // namespace nerfvdb
