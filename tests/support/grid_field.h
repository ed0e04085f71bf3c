// SPDX-License-Identifier: Apache-2.0
// Small fields for tests: cells chosen by a predicate, raw densities given by a function of the voxel.
#pragma once

#include <map>
#include <tuple>
#include <vector>

#include "vdb/voxel_field.h"

namespace nerfvdb::test {

inline Vec3i floorLeaf(const Vec3i& voxel) { return {voxel.x() >> 3, voxel.y() >> 3, voxel.z() >> 3}; }

/// Cells of the box [low, high) for which hasCell(ijk) is true.
template <typename HasCell>
Topology makeTopology(const Vec3i& dims, const Vec3i& low, const Vec3i& high, const HasCell& hasCell) {
    std::map<std::tuple<int, int, int>, LeafMask> leaves;
    for (int x = low.x(); x < high.x(); ++x)
        for (int y = low.y(); y < high.y(); ++y)
            for (int z = low.z(); z < high.z(); ++z)
                if (hasCell(Vec3i(x, y, z)))
                    setBit(leaves[{x >> 3, y >> 3, z >> 3}], brickOffset(x & 7, y & 7, z & 7));
    std::vector<Topology::LeafCells> cells;
    for (const auto& [leaf, mask] : leaves)
        cells.push_back({Vec3i(std::get<0>(leaf), std::get<1>(leaf), std::get<2>(leaf)), mask});
    return Topology(dims, cells);
}

/// Calls visit(ijk, index) for every active voxel; index is its place in field.density().
template <typename Visit>
void forEachVoxel(const Topology& topology, const Visit& visit) {
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        for (int i = 0; i < kLeafVoxels; ++i)
            if (testBit(topology.voxels()[leaf], i))
                visit(Vec3i(topology.leafCoords()[leaf] * kLeafDim + Vec3i(i >> 6, i >> 3 & 7, i & 7)),
                      leaf * kLeafVoxels + i);
}

template <typename Raw>
void setDensity(VoxelField& field, const Raw& raw) {
    forEachVoxel(field.topology(),
                 [&](const Vec3i& ijk, std::size_t index) { field.density()[index] = raw(ijk); });
}

/// Raw density of the field on all of Z^3: kEmptyRaw where no voxel is active.
inline float rawAt(const VoxelField& field, const Vec3i& ijk) {
    const int leaf = field.topology().findLeaf(floorLeaf(ijk));
    const int offset = brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
    if (leaf < 0 || !testBit(field.topology().voxels()[leaf], offset)) return kEmptyRaw;
    return field.density()[static_cast<std::size_t>(leaf) * kLeafVoxels + offset];
}

}  // namespace nerfvdb::test
