// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_plan.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "trainer/scene_box.h"
#include "trainer/scene_shells.h"

namespace nerfvdb {
namespace {

/// The axis along which the cameras are least apart; of those who walk in a line, along which more than one axis is short,
/// the one that stands upright in their pictures.
int upAxis(const Dataset& dataset, const Box& cameras) {
    constexpr double kShort = 0.1;  // of the longest
    Vec3d upright = Vec3d::Zero();
    for (const View& view : dataset.views) upright += view.camera.world_from_camera.col(1);
    int shortest = 0, up = -1;
    for (int axis = 0; axis < 3; ++axis) {
        if (cameras.size()[axis] < cameras.size()[shortest]) shortest = axis;
        if (cameras.size()[axis] <= kShort * cameras.size().maxCoeff() &&
            (up < 0 || std::abs(upright[axis]) > std::abs(upright[up])))
            up = axis;
    }
    return up >= 0 ? up : shortest;
}

}  // namespace

BlockGrid planBlocks(const Dataset& dataset, int columns, int rows, const std::optional<Box>& bounds) {
    if (dataset.views.empty())
        throw DataError(dataset.root.string(), "no views to train on", "at least one posed photograph");
    const Box cameras = boxOfCameras(dataset);
    const int up = upAxis(dataset, cameras);
    Box region = findSceneShells(dataset, bounds).inner;
    const BlockGrid axes{.columns = columns, .rows = rows, .up = up};
    for (int axis = 0; axis < 3; ++axis) {
        // A block without a camera would learn nothing; what lies beyond the cameras is in the outer blocks' margins.
        if (bounds || axes.countAlong(axis) == 1) continue;
        region.min[axis] = cameras.min[axis];
        region.max[axis] = cameras.max[axis];
        if (!(region.size()[axis] > 0))
            throw UsageError("--blocks", std::to_string(axes.countAlong(axis)) + " along " + "xyz"[axis] +
                                             ", where all cameras are at the same place",
                             "1 along " + std::string(1, "xyz"[axis]), "the ground's axes come in the order x, y, z");
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
