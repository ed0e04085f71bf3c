// SPDX-License-Identifier: Apache-2.0
#include "vdb/layer_cells.h"

namespace nerfvdb {

std::string strayLeaf(const Topology& topology, const Shells& shells) {
    if (shells.count == 1) return {};
    const Regions* const regions = shells.regions.get();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        if (topology.cells()[leaf] == LeafMask{}) continue;  // upper corners alone
        const Vec3i first = topology.leafCoords()[leaf] * kLeafDim;
        const int layer = shells.layerAt(first.x()), halvings = shells.halvingsOf(layer);
        const auto cells = [&](const std::string& what) {
            return "cells at (" + std::to_string(first.x()) + ", " + std::to_string(first.y()) + ", " +
                   std::to_string(first.z()) + "), " + what;
        };
        const Vec3i local = first - shells.corner(layer);
        if ((local.array() >= shells.extentOf(layer).array()).any()) return cells("between shells");
        if (!regions) continue;
        const int expected = regions->at(shells.shellOf(layer), shells.regionOf(layer, first, regions->dims));
        if (halvings != expected)
            return cells("halved " + std::to_string(halvings) + " times where a region says " + std::to_string(expected));
    }
    return {};
}

}  // namespace nerfvdb
