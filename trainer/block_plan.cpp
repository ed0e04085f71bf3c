// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_plan.h"

#include <algorithm>

#include "core/error.h"
#include "trainer/scene_box.h"

namespace nerfvdb {

BlockGrid planBlocks(const Dataset& dataset, int columns, int rows, const std::optional<Box>& bounds) {
    if (dataset.views.empty())
        throw DataError(dataset.root.string(), "no views to train on", "at least one posed photograph");
    Box cameras{dataset.views.front().camera.position, dataset.views.front().camera.position};
    for (const View& view : dataset.views) {
        cameras.min = cameras.min.cwiseMin(view.camera.position);
        cameras.max = cameras.max.cwiseMax(view.camera.position);
    }
    int up = 2;  // of equals the last: z
    for (const int axis : {1, 0})
        if (cameras.size()[axis] < cameras.size()[up]) up = axis;

    Box region = findSceneShells(dataset, bounds).inner;
    if (!bounds)
        for (int axis = 0; axis < 3; ++axis) {
            if (axis == up) continue;
            region.min[axis] = std::min(region.min[axis], cameras.min[axis]);
            region.max[axis] = std::max(region.max[axis], cameras.max[axis]);
        }
    return cutIntoBlocks(region, up, columns, rows);
}

std::vector<std::size_t> viewsOfBlocks(const BlockGrid& grid, const Dataset& dataset) {
    std::vector<std::size_t> counts;
    for (const BlockId& block : grid.blocks())
        counts.push_back(static_cast<std::size_t>(
            std::count_if(dataset.views.begin(), dataset.views.end(),
                          [&](const View& view) { return grid.takesCameraAt(block, view.camera.position); })));
    return counts;
}

}  // namespace nerfvdb
