// SPDX-License-Identifier: Apache-2.0
// Small random volumes for tests, part of whose voxels lie at negative coordinates.
#pragma once

#include "core/random.h"
#include "vdb/volume.h"

namespace nerfvdb::test {

/// 24 voxels a side from (-12, -8, 0), half of them active; sigma up to `largest_sigma`.
inline Volume randomVolume(double voxel_size = 0.1, float largest_sigma = 20.0f, std::uint64_t seed = 1) {
    std::vector<Topology::LeafCells> active;
    for (int x = -2; x < 2; ++x)
        for (int y = -1; y < 2; ++y)
            for (int z = 0; z < 3; ++z) {
                Topology::LeafCells leaf{{x, y, z}, {}};
                for (int offset = 0; offset < kLeafVoxels; ++offset) {
                    const Vec3i voxel = leaf.leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
                    const bool is_inside = voxel.x() >= -12 && voxel.x() < 12;
                    const auto bits = randomBits(seed, static_cast<std::uint64_t>(x * 100 + y * 10 + z + 1000), offset);
                    if (is_inside && bits % 2) setBit(leaf.cells, offset);
                }
                active.push_back(leaf);
            }
    Volume volume(active, {Vec3d(0.5, -1, 2), voxel_size});
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
            const std::size_t i = leaf * kLeafVoxels + offset;
            const auto at = [&](std::uint64_t stream) {
                return unitFloat(static_cast<std::uint32_t>(randomBits(seed + 1, stream, i)));
            };
            if (testBit(volume.active()[leaf], offset)) volume.sigma()[i] = largest_sigma * (0.05f + 0.95f * at(0));
            for (int c = 0; c < 3; ++c) volume.color()[i * Volume::kChannels + c] = 0.05f + 0.95f * at(1 + c);
        });
    return volume;
}

/// A voxel of a volume in the coordinates that it was made with.
inline Vec3i givenVoxel(const Volume& volume, std::size_t leaf, int offset) {
    return volume.topology().leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7) +
           volume.firstVoxel();
}

}  // namespace nerfvdb::test
