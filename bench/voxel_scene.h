// SPDX-License-Identifier: Apache-2.0
// A small scene given voxel by voxel, and what one ray makes of it: what the cost of skipping is measured on.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/random.h"
#include "vdb/ray_tracer.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// A dense field of values given by voxel, sigma(Vec3i) per voxel and colour(Vec3i, channel) of three: density scale 1,
/// voxel size 1, four channels.
struct VoxelScene {
    static constexpr int kChannels = 4;
    VoxelField field;
    template <typename Sigma, typename Colour>
    VoxelScene(const Vec3i& dims, const Sigma& sigma, const Colour& colour) {
        std::vector<Topology::LeafCells> leaves;
        for (int x = 0; x < dims.x() / kLeafDim; ++x)
            for (int y = 0; y < dims.y() / kLeafDim; ++y)
                for (int z = 0; z < dims.z() / kLeafDim; ++z) {
                    Topology::LeafCells leaf{Vec3i(x, y, z), {}};
                    for (int i = 0; i < kLeafVoxels; ++i)
                        if (((leaf.leaf * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7)).array() <
                             dims.array() - 1)
                                .all())
                            setBit(leaf.cells, i);
                    leaves.push_back(leaf);
                }
        field = VoxelField(Topology(dims, leaves), {}, kChannels, 1.0);
        for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
            for (int i = 0; i < kLeafVoxels; ++i) {
                const Vec3i at =
                    field.topology().leafCoords()[leaf] * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7);
                const std::size_t voxel = leaf * kLeafVoxels + static_cast<std::size_t>(i);
                field.density()[voxel] = static_cast<float>(std::log(std::max(sigma(at), 1e-8)));
                for (int c = 0; c < 3; ++c)
                    field.features()[voxel * kChannels + static_cast<std::size_t>(c)] =
                        static_cast<float>(colour(at, c));
            }
    }
    Occupancy everything() const {
        return occupancyFromCells(field.topology(),
                                  {field.topology().cells().begin(), field.topology().cells().end()});
    }
};

/// A step of half a voxel, and all of a ray's samples read.
TraceOptions nothingSkipped();

/// What a ray sees, with jitter 1/2.
struct RaySight {
    std::array<double, 3> mean{};  // F of the first three channels
    double opacity = 0;
    KeptSamples kept;
    TraceCounters counters;
    double colour(int c, double background) const { return opacity * mean[c] + (1 - opacity) * background; }
};

RaySight look(const TraceScene& scene, const Ray& ray, const TraceOptions& options);

/// A number in [low, high) for a seed and an index.
inline double randomBetween(double low, double high, std::uint64_t seed, std::uint64_t index) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 14, index)));
}

}  // namespace nerfvdb
