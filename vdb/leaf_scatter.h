// SPDX-License-Identifier: Apache-2.0
// The adjoint of reading the grid, without a grid of gradients. Samples are binned by the leaves that they touch;
// each leaf is then summed by one task, in the order of the rays, in a buffer that fits the nearest caches, and
// handed on as soon as the next one has been summed. So sums do not depend on the number of threads, nothing is
// locked, and no gradient ever travels to main memory.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {

inline constexpr int kScatterParts = 128;  // ranges of leaves, the tasks of a scatter

/// What one tile of rays leaves behind. Moved, not copied: samples point into it.
struct TileGradients {
    KeptSamples kept;
    std::vector<float> dl_dray_features;  // [ray][channels]

    // What leaves need to know of each sample, side by side: they are met in a leaf's order, not in a ray's. [kept.n] and more
    std::vector<SampleGradient> samples;

    /// One sample in one leaf, see LeafContribution.
    struct Touch {
        std::int32_t leaf;
        std::uint32_t sample : 29, corner : 3;
    };
    std::vector<Touch> touches;  // [part_begin.back()] and more, sorted by part, in sample order inside
    std::array<std::uint32_t, kScatterParts + 1> part_begin{};

    /// Fills samples and touches from kept. dl_dray_features must stay where it is until they have been summed.
    void bin(const Topology& topology, int channels);

    TileGradients() = default;
    TileGradients(TileGradients&&) = default;
    TileGradients& operator=(TileGradients&&) = default;

private:
    std::vector<Touch> unsorted_;
};

/// Sums gradients leaf by leaf.
class LeafScatter {
public:
    /// Called once for each touched leaf, from any thread, one leaf at a time per thread. `gradient` must be
    /// left cleared, as rmsPropLeaf does; `seen` has the bits of the leaf's own cells that hold a kept sample
    /// of at least `min_seen` weight.
    using UseLeaf = std::function<void(std::int32_t leaf, const LeafGradient& gradient, const LeafMask& seen)>;
    /// Called before, mostly with another leaf to be summed in between: time for what UseLeaf will read to arrive.
    using ExpectLeaf = std::function<void(std::int32_t leaf, const LeafGradient& gradient)>;
    void run(const Topology& topology, int channels, std::span<const TileGradients> tiles, const UseLeaf& use,
             float min_seen = 0, const ExpectLeaf& expect = {});

private:
    /// A leaf that has been summed.
    struct Summed {
        std::int32_t leaf = -1;
        HugeArray<float> density, features;
        LeafMask touched{}, seen{};
        LeafGradient gradient() { return {density.data(), features.data(), touched.data()}; }
    };
    struct Scratch {
        std::vector<LeafContribution> contributions;
        std::vector<std::uint32_t> begin;
        std::array<Summed, 2> summed;
    };
    PerThread<Scratch> scratch_;
};

}  // namespace nerfvdb
