// SPDX-License-Identifier: Apache-2.0
// A model like those that training leaves: a shell of voxels with smooth values plus noise.
#pragma once

#include <cmath>
#include <vector>

#include "core/random.h"
#include "vdb/model.h"

namespace nerfvdb::test {

/// Uniform in [-1, 1), a pure function of its arguments.
inline float signedNoise(std::uint64_t stream, std::uint64_t index) {
    return 2 * unitFloat(static_cast<std::uint32_t>(randomBits(7, stream, index))) - 1;
}

inline Vec3i voxelOf(const Topology& topology, std::size_t leaf, int offset) {
    return topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
}

/// All cells within two voxels of a sphere of diameter 0.75 n, in a box of n^3 voxels.
inline Topology shellTopology(int n) {
    std::vector<Topology::LeafCells> cells;
    for (int x = 0; x < n / 8; ++x)
        for (int y = 0; y < n / 8; ++y)
            for (int z = 0; z < n / 8; ++z) {
                Topology::LeafCells entry{{x, y, z}, {}};
                for (int offset = 0; offset < kLeafVoxels; ++offset) {
                    const Vec3i ijk = Vec3i(x, y, z) * 8 + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
                    const double radius = (ijk.cast<double>() - Vec3d::Constant(n / 2)).norm();
                    if (std::abs(radius - n * 0.375) < 2 && ijk.maxCoeff() < n - 1) setBit(entry.cells, offset);
                }
                cells.push_back(entry);
            }
    return Topology(Vec3i::Constant(n), cells);
}

inline Model shellModel(int n = 48, int channels = 8, float feature_scale = 1.0f) {
    Model model;
    model.field = VoxelField(shellTopology(n), {Vec3d(-1.2, 0.3, 1.0 / 3), 2.4 / n}, channels, 40.0);
    const Topology& topology = model.field.topology();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            model.field.density()[voxel] = 2 + 3 * signedNoise(0, voxel);
            for (int k = 0; k < channels; ++k)
                model.field.features()[voxel * channels + k] =
                    feature_scale * (std::sin(0.3f * static_cast<float>(topology.leafCoords()[leaf][k % 3] + k)) +
                                     0.3f * signedNoise(k + 1, voxel));
        });
    model.decoder = Decoder(channels, 5);
    model.background = Vec3f(0.25f, 0.5f, 1.0f);
    model.info = {"120,300,900", 0xfedcba9876543210ull, 31.25};
    return model;
}

}  // namespace nerfvdb::test
