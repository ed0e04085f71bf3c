// SPDX-License-Identifier: Apache-2.0
#include "vdb/adapt.h"

#include <openvdb/tools/Morphology.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <numbers>
#include <vector>

#include "core/parallel.h"
#include "vdb/topology_tree.h"

namespace nerfvdb {

namespace {

/// Each of a leaf's cells as eight, in the eight leaves from `first` on.
void addHalved(const LeafMask& cells, const Vec3i& first, std::vector<Topology::LeafCells>& fine) {
    std::array<LeafMask, 8> octants{};
    forEachBit(cells, [&](int offset) {
        const int x = (offset >> 6) * 2, y = (offset >> 3 & 7) * 2, z = (offset & 7) * 2;
        LeafMask& octant = octants[(x >> 3) * 4 + (y >> 3) * 2 + (z >> 3)];
        for (int child = 0; child < 8; ++child)
            setBit(octant, brickOffset((x & 7) + (child >> 2), (y & 7) + (child >> 1 & 1), (z & 7) + (child & 1)));
    });
    for (int octant = 0; octant < 8; ++octant)
        fine.push_back({first + Vec3i(octant >> 2, octant >> 1 & 1, octant & 1), octants[octant]});
}

/// Corner of a layer's box, in leaves.
Vec3i cornerLeaf(const Shells& shells, int layer) { return shells.corner(layer) / kLeafDim; }

}  // namespace

Topology subdivide(const Topology& coarse, std::span<const LeafMask> cells) {
    std::vector<Topology::LeafCells> fine;
    for (std::size_t leaf = 0; leaf < coarse.leafCount(); ++leaf)
        addHalved(cells[leaf], coarse.leafCoords()[leaf] * 2, fine);
    return Topology(coarse.dims() * 2, fine);
}

Topology halveRegions(const Topology& topology, const Shells& from, const Shells& to) {
    std::vector<Topology::LeafCells> cells;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        const Vec3i coord = topology.leafCoords()[leaf];
        const int layer = from.layerAt(coord.x() * kLeafDim), shell = from.shellOf(layer);
        const Vec3i local = coord - cornerLeaf(from, layer);
        // Leaves beyond the last cells have upper corners alone, and no cells that could belong to a region.
        const bool has_cells = (local.array() * kLeafDim < from.extentOf(layer).array()).all();
        const Vec3i region = from.regionOf(layer, coord * kLeafDim, to.regions->dims);
        if (has_cells && to.regions->at(shell, region) > from.halvingsOf(layer))
            addHalved(topology.cells()[leaf], local * 2 + cornerLeaf(to, layer + to.count), cells);
        else
            cells.push_back({coord, topology.cells()[leaf]});
    }
    return Topology(to.dims().cwiseMax(topology.dims()), cells);
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

namespace {

/// Values of the voxels `wanted` of a leaf of halved cells, from around leaf `base` of the coarse ones, in which it begins at
/// voxel `half` (0 or 4 along each axis).
void interpolateLeaf(const Topology& coarse, const Vec3i& base, const Vec3i& half, const LeafMask& wanted, int channels,
                     std::span<const float> in, float* out) {
    std::array<int, 8> owners;
    for (int n = 0; n < 8; ++n) owners[n] = coarse.findLeaf(base + Vec3i(n >> 2, n >> 1 & 1, n & 1));
    forEachBit(wanted, [&](int offset) {
        const int v[3] = {offset >> 6, offset >> 3 & 7, offset & 7};
        float* const target = out + static_cast<std::size_t>(offset) * channels;
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
            const float* const source = &in[(static_cast<std::size_t>(owners[owner]) * kLeafVoxels +
                                             brickOffset(p[0] & 7, p[1] & 7, p[2] & 7)) * channels];
            for (int c = 0; c < channels; ++c) target[c] += source[c];
            ++n_found;
        }
        for (int c = 0; c < channels; ++c) target[c] /= static_cast<float>(n_found);
    });
}

}  // namespace

void refineValues(const Topology& coarse, const Topology& fine, int channels, std::span<const float> in,
                  std::span<float> out) {
    if (channels == 0) return;
    parallelRanges(fine.leafCount(), 16, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const Vec3i coord = fine.leafCoords()[leaf], base = coord / 2;
            interpolateLeaf(coarse, base, (coord - base * 2) * 4, fine.voxels()[leaf], channels, in,
                            &out[leaf * kLeafVoxels * static_cast<std::size_t>(channels)]);
        }
    });
}

void halveValues(const Topology& from_topology, const Shells& from, const Topology& to_topology, int channels,
                 std::span<const float> in, std::span<float> out) {
    if (channels == 0) return;
    parallelRanges(to_topology.leafCount(), 16, [&](std::size_t first, std::size_t last) {
        for (std::size_t leaf = first; leaf < last; ++leaf) {
            const Vec3i coord = to_topology.leafCoords()[leaf];
            float* const target = &out[leaf * kLeafVoxels * static_cast<std::size_t>(channels)];
            LeafMask is_new = to_topology.voxels()[leaf];
            if (const int source = from_topology.findLeaf(coord); source >= 0) {
                const LeafMask& were = from_topology.voxels()[source];
                forEachBit(is_new, [&](int offset) {
                    if (testBit(were, offset))
                        std::copy_n(&in[(static_cast<std::size_t>(source) * kLeafVoxels + offset) * channels], channels,
                                    target + static_cast<std::size_t>(offset) * channels);
                });
                for (int word = 0; word < kLeafWords; ++word) is_new[word] &= ~were[word];
            }
            const int layer = from.layerAt(coord.x() * kLeafDim);
            if (from.halvingsOf(layer) == 0) continue;
            const Vec3i local = coord - cornerLeaf(from, layer), half = local / 2;
            interpolateLeaf(from_topology, half + cornerLeaf(from, layer - from.count), (local - half * 2) * 4, is_new,
                            channels, in, target);
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

VoxelField halveField(VoxelField&& field, Topology halved, const Shells& shells) {
    const Topology& topology = field.topology();
    const auto moved = [&](int channels, HugeArray<float> old_values, float nothing) {
        HugeArray<float> values(halved.leafCount() * kLeafVoxels * static_cast<std::size_t>(channels), nothing);
        halveValues(topology, field.shells(), halved, channels, old_values.span(), values.span());
        return values;
    };
    HugeArray<float> features = moved(field.channels(), field.takeFeatures(), 0);
    HugeArray<float> density = moved(1, field.takeDensity(), kEmptyRaw);
    for (std::size_t leaf = 0; leaf < halved.leafCount(); ++leaf) {
        const Vec3i coord = halved.leafCoords()[leaf];
        if (shells.halvingsOf(shells.layerAt(coord.x() * kLeafDim)) == 0) continue;
        const int before = topology.findLeaf(coord);
        forEachBit(halved.voxels()[leaf], [&](int offset) {
            if (before < 0 || !testBit(topology.voxels()[before], offset))
                density[leaf * kLeafVoxels + offset] =
                    std::min(density[leaf * kLeafVoxels + offset], kMaxRaw) - std::numbers::ln2_v<float>;
        });
    }
    return VoxelField(std::move(halved), field.frame(), shells, field.channels(), field.densityScale(), std::move(density),
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
