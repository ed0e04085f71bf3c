// SPDX-License-Identifier: Apache-2.0
// What hangs together, without the crumbs around it.
#pragma once

#include <vector>

#include "vdb/topology.h"

namespace nerfvdb {

/// `cells` (a subset per leaf) of those pieces that have at least `share` of the largest one's cells. Cells that share a face,
/// an edge or a corner are of one piece.
std::vector<LeafMask> largestPieces(const Topology& topology, const std::vector<LeafMask>& cells, double share);

}  // namespace nerfvdb
