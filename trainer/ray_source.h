// SPDX-License-Identifier: Apache-2.0
// Which pixels a step looks at: drawn uniformly from the 8x8 pixel tiles in which something can be seen at all, and never
// one that a mask leaves out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "trainer/dataset.h"
#include "vdb/occupancy.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// A ray to train on, and what its pixel shows.
struct TrainingRay {
    Ray ray;
    float jitter;              // of the first sample along the ray, [0, 1)
    std::array<float, 4> rgba; // straight sRGB values and alpha, [0, 1]
    std::uint64_t bits;        // more random bits, for whoever needs them
    int view, x, y;            // where it came from, for messages
};

/// Draws rays as a pure function of (seed, step, index). Keeps a reference to the data set.
class RaySource {
public:
    RaySource(const Dataset& dataset, std::uint64_t seed) : dataset_(&dataset), seed_(seed) {}

    /// Finds the pixel tiles that occupied leaves project to; all others can only show the background. Tiles without a
    /// pixel that counts are left out.
    void update(const VoxelField& field, const Occupancy& occupancy);

    /// Takes all pixel tiles.
    void useAll();

    /// The rays of a step from index `first` on.
    void draw(std::uint64_t step, std::uint64_t first, std::span<TrainingRay> rays) const;
    TrainingRay draw(std::uint64_t step, std::uint64_t index) const;

    /// Photographs on disk count as this process's memory where they were read, until they are let go: they are, by
    /// boundMapped, when the process has mapped more than so many bytes of files.
    void limitMapped(std::size_t bytes) { mapped_limit_ = bytes; }
    /// To be called often; costs nothing without a limit. Threads: any.
    void boundMapped() const;

    std::size_t tileCount() const { return tiles_.size(); }

private:
    struct Tile {
        std::uint16_t view, x, y;  // in tiles
    };
    const Tile& tileOf(std::uint64_t bits) const;
    /// Fills view, x, y, and bits with random ones that are left.
    void pick(std::uint64_t bits, TrainingRay& drawn) const;

    const Dataset* dataset_;
    std::uint64_t seed_;
    std::optional<std::size_t> mapped_limit_;
    std::vector<Tile> tiles_;
};

}  // namespace nerfvdb
