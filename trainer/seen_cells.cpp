// SPDX-License-Identifier: Apache-2.0
#include "trainer/seen_cells.h"

#include <algorithm>

#include "trainer/looks.h"

namespace nerfvdb {

int strideOfLooks(const Dataset& dataset, const VoxelField& field) {
    double shortest = 0;  // focal length
    for (const View& view : dataset.views)
        shortest = shortest == 0 ? view.camera.fx : std::min(shortest, view.camera.fx);
    return std::max(1, static_cast<int>(shortest * field.frame().voxel_size / field.shellBox(0).size().norm()));
}

void markSeenCells(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy, float min_seen, int stride,
                   std::vector<LeafMask>& seen) {
    lookThrough(dataset, field, occupancy, min_seen, stride, [&](const View&, const RayTracer&, const KeptSamples& kept) {
        for (int k = 0; k < kept.n; ++k) setBitShared(seen[static_cast<std::size_t>(kept.leaf[k])], kept.cell[k]);
    });
}

}  // namespace nerfvdb
