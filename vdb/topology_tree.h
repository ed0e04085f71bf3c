// SPDX-License-Identifier: Apache-2.0
// The OpenVDB side of a topology; included only by .cpp files that work on trees (the header is heavy).
#pragma once

#include "vdb/openvdb_grids.h"
#include "vdb/topology.h"

namespace nerfvdb {

/// OpenVDB's bit mask of a leaf; both use the same bit order.
inline openvdb::util::NodeMask<3> nodeMask(const LeafMask& mask) {
    openvdb::util::NodeMask<3> result;
    for (int word = 0; word < kLeafWords; ++word) result.getWord<std::uint64_t>(word) = mask[word];
    return result;
}

inline LeafMask leafMask(const openvdb::util::NodeMask<3>& mask) {
    LeafMask result;
    for (int word = 0; word < kLeafWords; ++word) result[word] = mask.getWord<std::uint64_t>(word);
    return result;
}

/// Index coordinate of a leaf's first voxel.
inline openvdb::Coord leafOrigin(const Vec3i& leaf) {
    return {leaf.x() * kLeafDim, leaf.y() * kLeafDim, leaf.z() * kLeafDim};
}

/// A tree whose active values are the topology's voxels; its leaves come in the topology's leaf order.
openvdb::MaskTree voxelTree(const Topology& topology);

}  // namespace nerfvdb
