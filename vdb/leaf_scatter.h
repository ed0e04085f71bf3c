// SPDX-License-Identifier: Apache-2.0
// The adjoint of reading the grid, without a grid of gradients. Samples are binned by the leaves that they touch;
// each leaf is then summed by one task, in the order of the rays, in a buffer that fits the first-level cache,
// and handed on to be used at once. So sums do not depend on the number of threads, nothing is locked, and
// no gradient ever travels to main memory.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {

inline constexpr int kScatterParts = 64;  // ranges of leaves, the tasks of a scatter

/// What one tile of rays leaves behind.
struct TileGradients {
    KeptSamples kept;
    std::vector<float> dl_dray_features;  // [ray][channels]

    /// What a leaf needs to know of a sample, side by side: it is met in the leaf's order, not in the ray's.
    struct Sample {
        std::int32_t cell, ray;
        float x, y, z;
        float weight, dl_draw;
    };
    std::vector<Sample> samples;  // [kept]

    /// One sample in one leaf. `corner` (bits x, y, z) says by which faces the sample's cell reaches into it.
    struct Touch {
        std::int32_t leaf;
        std::uint32_t sample : 29, corner : 3;
    };
    std::vector<Touch> touches;                              // sorted by part, in sample order inside
    std::array<std::uint32_t, kScatterParts + 1> part_begin{};

    /// Fills samples and touches from kept.
    void bin(const Topology& topology);

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
    void run(const Topology& topology, int channels, std::span<const TileGradients> tiles, const UseLeaf& use,
             float min_seen = 0);

private:
    struct Entry {
        std::int32_t leaf;
        std::uint32_t tile;
        TileGradients::Touch touch;
    };
    struct Scratch {
        std::vector<Entry> entries;
        std::vector<std::uint32_t> begin;
        std::vector<LeafContribution> contributions;
        HugeArray<float> density, features;
        LeafMask touched{};
    };
    PerThread<Scratch> scratch_;
};

}  // namespace nerfvdb
