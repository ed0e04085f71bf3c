// SPDX-License-Identifier: Apache-2.0
// What files claim of cells and of the layers (shells.h) that they lie in, held against each other.
#pragma once

#include <string>

#include "vdb/shells.h"
#include "vdb/topology.h"

namespace nerfvdb {

/// Empty if every leaf with cells lies in the box of a layer, and in regions that are halved as often as that layer is; else
/// the first one that does not, in words. Rays would pass by such cells, and what is halved later would be made from nothing.
/// `shells` fit the topology's dims.
std::string strayLeaf(const Topology& topology, const Shells& shells);

}  // namespace nerfvdb
