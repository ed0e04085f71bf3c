// SPDX-License-Identifier: Apache-2.0
// Small random fields for tests: every cell of a box, smooth random values, nothing special about any voxel.
#pragma once

#include "core/random.h"
#include "vdb/voxel_field.h"

namespace nerfvdb::test {

/// All cells of a box of `dims` voxels, with the share `density` of them kept (by a hash).
inline Topology randomTopology(const Vec3i& dims, double share, std::uint64_t seed) {
    std::vector<Topology::LeafCells> cells;
    for (int x = 0; x < dims.x() - 1; ++x)
        for (int y = 0; y < dims.y() - 1; ++y)
            for (int z = 0; z < dims.z() - 1; ++z) {
                const std::uint64_t bits = randomBits(seed, static_cast<std::uint64_t>(x * 4096 + y), z);
                if (unitFloat(static_cast<std::uint32_t>(bits)) >= share) continue;
                LeafMask mask{};
                setBit(mask, brickOffset(x & 7, y & 7, z & 7));
                cells.push_back({Vec3i(x / 8, y / 8, z / 8), mask});
            }
    return Topology(dims, cells);
}

/// Uniform in [low, high), a pure function of its arguments.
inline float randomIn(float low, float high, std::uint64_t seed, std::uint64_t i) {
    return low + (high - low) * unitFloat(static_cast<std::uint32_t>(randomBits(seed, 99, i)));
}

/// A field with raw densities in [low, high) and features in [-1, 1), values only where voxels exist.
inline VoxelField randomField(const Vec3i& dims, int channels, double share, float low, float high,
                              std::uint64_t seed) {
    GridFrame frame;
    frame.origin = Vec3d(-1, -0.5, 2);
    frame.voxel_size = 0.1;
    VoxelField field(randomTopology(dims, share, seed), frame, channels, 10.0);
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            if (!testBit(field.topology().voxels()[leaf], offset)) continue;
            const std::size_t i = leaf * kLeafVoxels + offset;
            field.density()[i] = randomIn(low, high, seed, i);
            for (int c = 0; c < channels; ++c)
                field.features()[i * channels + c] = randomIn(-1, 1, seed + 1, i * channels + c);
        }
    return field;
}

}  // namespace nerfvdb::test
