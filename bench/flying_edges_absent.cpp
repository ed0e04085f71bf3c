// SPDX-License-Identifier: Apache-2.0
// Stands for flying_edges_peer.cpp where VTK was not found.
#include "bench/mesh_peers.h"

namespace nerfvdb {

std::optional<MeshPeer> flyingEdgesPeer(const VoxelField&, float) { return std::nullopt; }

}  // namespace nerfvdb
