// SPDX-License-Identifier: Apache-2.0
#include "vdb/adapt.h"

#include <openvdb/tools/Morphology.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "core/parallel.h"
#include "vdb/topology_tree.h"

namespace nerfvdb {

Topology subdivide(const Topology& coarse, std::span<const LeafMask> cells) {
    std::vector<Topology::LeafCells> fine;
    for (std::size_t leaf = 0; leaf < coarse.leafCount(); ++leaf) {
        std::array<LeafMask, 8> octants{};
        forEachBit(cells[leaf], [&](int offset) {
            const int x = (offset >> 6) * 2, y = (offset >> 3 & 7) * 2, z = (offset & 7) * 2;
            LeafMask& octant = octants[(x >> 3) * 4 + (y >> 3) * 2 + (z >> 3)];
            for (int child = 0; child < 8; ++child)
                setBit(octant, brickOffset((x & 7) + (child >> 2), (y & 7) + (child >> 1 & 1), (z & 7) + (child & 1)));
        });
        for (int octant = 0; octant < 8; ++octant)
            fine.push_back({coarse.leafCoords()[leaf] * 2 + Vec3i(octant >> 2, octant >> 1 & 1, octant & 1),
                            octants[octant]});
    }
    return Topology(coarse.dims() * 2, fine);
}

Topology prune(const Topology& topology, std::span<const LeafMask> cells) {
    std::vector<Topology::LeafCells> kept;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        kept.push_back({topology.leafCoords()[leaf], cells[leaf]});
    return Topology(topology.dims(), kept);
}

std::vector<LeafMask> dilateCells(const Topology& topology, std::span<const LeafMask> cells) {
    openvdb::MaskTree tree;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        tree.touchLeaf(leafOrigin(topology.leafCoords()[leaf]))->setValueMask(nodeMask(cells[leaf]));
    openvdb::tools::dilateActiveValues(tree, 1, openvdb::tools::NN_FACE_EDGE_VERTEX, openvdb::tools::IGNORE_TILES);
    std::vector<LeafMask> result(topology.leafCount());
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const auto* grown = tree.probeConstLeaf(leafOrigin(topology.leafCoords()[leaf]));
        if (grown) result[leaf] = leafMask(grown->getValueMask());
        for (int word = 0; word < kLeafWords; ++word) result[leaf][word] &= topology.cells()[leaf][word];
    }
    return result;
}

void refineValues(const Topology& coarse, const Topology& fine, int channels, std::span<const float> in,
                  std::span<float> out) {
    if (channels == 0) return;
    parallelRanges(fine.leafCount(), 16, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const Vec3i fine_coord = fine.leafCoords()[leaf];
            const Vec3i base = fine_coord / 2;
            const Vec3i half = (fine_coord - base * 2) * 4;  // where this leaf begins inside its coarse leaf
            std::array<int, 8> owners;
            for (int n = 0; n < 8; ++n) owners[n] = coarse.findLeaf(base + Vec3i(n >> 2, n >> 1 & 1, n & 1));

            forEachBit(fine.voxels()[leaf], [&](int offset) {
                const int v[3] = {offset >> 6, offset >> 3 & 7, offset & 7};
                float* const target = &out[(leaf * kLeafVoxels + offset) * channels];
                std::fill_n(target, channels, 0.0f);
                int n_found = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    const int bit[3] = {corner >> 2, corner >> 1 & 1, corner & 1};
                    if ((bit[0] && !(v[0] & 1)) || (bit[1] && !(v[1] & 1)) || (bit[2] && !(v[2] & 1))) continue;
                    int p[3], owner = 0;
                    for (int axis = 0; axis < 3; ++axis) {
                        p[axis] = half[axis] + v[axis] / 2 + bit[axis];
                        owner = owner * 2 + (p[axis] >> 3);
                    }
                    if (owners[owner] < 0) continue;  // cannot be: a fine voxel lies in a coarse cell that exists
                    const float* const source =
                        &in[(static_cast<std::size_t>(owners[owner]) * kLeafVoxels +
                             brickOffset(p[0] & 7, p[1] & 7, p[2] & 7)) * channels];
                    for (int c = 0; c < channels; ++c) target[c] += source[c];
                    ++n_found;
                }
                for (int c = 0; c < channels; ++c) target[c] /= static_cast<float>(n_found);
            });
        }
    });
}

void copyValues(const Topology& from, const Topology& to, int channels, std::span<const float> in,
                std::span<float> out) {
    if (channels == 0) return;
    parallelRanges(to.leafCount(), 16, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const int source = from.findLeaf(to.leafCoords()[leaf]);
            if (source < 0) continue;
            forEachBit(to.voxels()[leaf], [&](int offset) {
                std::copy_n(&in[(static_cast<std::size_t>(source) * kLeafVoxels + offset) * channels], channels,
                            &out[(leaf * kLeafVoxels + offset) * channels]);
            });
        }
    });
}

VoxelField refineField(const VoxelField& field, Topology fine) {
    return refineField(copyField(field, field.topology()), std::move(fine));
}

VoxelField refineField(VoxelField&& field, Topology fine) {
    GridFrame frame = field.frame();
    frame.voxel_size *= 0.5;
    Shells shells = field.shells().subdivided();
    if (shells.count == 1) shells.extent = fine.dims() - Vec3i::Ones();
    const auto refined = [&](int channels, HugeArray<float> coarse_values, float nothing) {
        HugeArray<float> values(fine.leafCount() * kLeafVoxels * static_cast<std::size_t>(channels), nothing);
        refineValues(field.topology(), fine, channels, coarse_values.span(), values.span());
        return values;
    };
    HugeArray<float> features = refined(field.channels(), field.takeFeatures(), 0);
    HugeArray<float> density = refined(1, field.takeDensity(), kEmptyRaw);
    return VoxelField(std::move(fine), frame, shells, field.channels(), field.densityScale(), std::move(density),
                      std::move(features));
}

VoxelField pruneField(VoxelField&& field, Topology pruned) {
    HugeArray<float> density = field.takeDensity(), features = field.takeFeatures();
    const std::size_t channels = static_cast<std::size_t>(field.channels());
    // Leaves keep their order, so each moves towards the begin, to where nothing is that is still needed.
    for (std::size_t leaf = 0; leaf < pruned.leafCount(); ++leaf) {
        const auto source = static_cast<std::size_t>(field.topology().findLeaf(pruned.leafCoords()[leaf]));
        const std::size_t to = leaf * kLeafVoxels, from = source * kLeafVoxels;
        if (to != from) {
            std::memmove(&density[to], &density[from], kLeafVoxels * sizeof density[0]);
            std::memmove(&features[to * channels], &features[from * channels],
                         kLeafVoxels * channels * sizeof features[0]);
        }
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            if (testBit(pruned.voxels()[leaf], offset)) continue;
            density[to + offset] = kEmptyRaw;
            std::fill_n(&features[(to + offset) * channels], channels, 0.0f);
        }
    }
    density.truncate(pruned.leafCount() * kLeafVoxels);
    features.truncate(pruned.leafCount() * kLeafVoxels * channels);
    return VoxelField(std::move(pruned), field.frame(), field.shells(), field.channels(), field.densityScale(),
                      std::move(density), std::move(features));
}

VoxelField copyField(const VoxelField& field, Topology to) {
    VoxelField result(std::move(to), field.frame(), field.shells(), field.channels(), field.densityScale());
    copyValues(field.topology(), result.topology(), 1, field.density(), result.density());
    copyValues(field.topology(), result.topology(), field.channels(), field.features(), result.features());
    return result;
}

}  // namespace nerfvdb
