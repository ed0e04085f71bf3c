// SPDX-License-Identifier: Apache-2.0
#include "vdb/block_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr int kMultiple = 8;  // sides of shells are multiples of it

int roundedUp(double voxels) { return kMultiple * std::max(1, static_cast<int>(std::ceil(voxels / kMultiple - 1e-9))); }

}  // namespace

std::vector<BlockId> BlockGrid::blocks() const {
    std::vector<BlockId> all;
    for (int i = 0; i < columns; ++i)
        for (int j = 0; j < rows; ++j) all.push_back({i, j});
    return all;
}

Vec3i BlockGrid::margin() const {
    Vec3i margin = Vec3i::Zero();
    for (int axis = 0; axis < 3; ++axis)
        if (countAlong(axis) > 1) margin[axis] = kMargin;
    return margin;
}

Vec3i BlockGrid::coreCorner(const BlockId& block) const {
    return {numberAlong(block, 0) * core.x(), numberAlong(block, 1) * core.y(), numberAlong(block, 2) * core.z()};
}

Box BlockGrid::coreBox(const BlockId& block) const {
    const Vec3i corner = coreCorner(block);
    return {origin + voxel_size * corner.cast<double>(), origin + voxel_size * (corner + core).cast<double>()};
}

Box BlockGrid::box(const BlockId& block) const {
    const Vec3i corner = boxCorner(block);
    return {origin + voxel_size * corner.cast<double>(),
            origin + voxel_size * (corner + core + 2 * margin()).cast<double>()};
}

Box BlockGrid::region() const {
    return {origin, coreBox({columns - 1, rows - 1}).max};
}

double BlockGrid::weight(const BlockId& block, const Vec3d& world) const {
    double weight = 1;
    for (const int axis : {axisOfColumns(), axisOfRows()}) {
        const double at = (world[axis] - origin[axis]) / voxel_size;
        // From 0 to 1 across the lower border of block n; there is none before the first and behind the last.
        const auto risen = [&](int n) {
            if (n == 0) return 1.0;
            if (n == countAlong(axis)) return 0.0;
            return std::clamp((at - n * core[axis]) / (2 * kFade) + 0.5, 0.0, 1.0);
        };
        const int n = numberAlong(block, axis);
        weight *= risen(n) - risen(n + 1);
    }
    return weight;
}

bool BlockGrid::takesCameraAt(const BlockId& block, const Vec3d& world) const {
    const Box own = box(block);
    for (const int axis : {axisOfColumns(), axisOfRows()}) {
        const int n = numberAlong(block, axis);
        if (n > 0 && world[axis] < own.min[axis]) return false;
        if (n + 1 < countAlong(axis) && world[axis] > own.max[axis]) return false;
    }
    return true;
}

BlockGrid cutIntoBlocks(const Box& region, int up, int columns, int rows) {
    if (columns < 1 || rows < 1 || columns > kMostBlocks || rows > kMostBlocks)
        throw UsageError("--blocks", std::to_string(columns) + "x" + std::to_string(rows),
                         "1 to " + std::to_string(kMostBlocks) + " along each axis");
    if (!region.min.allFinite() || !region.max.allFinite() || (region.size().array() <= 0).any())
        throw UsageError("--blocks", "a region that is empty or not finite", "min < max on every axis");

    BlockGrid grid;
    grid.up = up;
    grid.columns = columns;
    grid.rows = rows;
    const Vec3i margin = grid.margin();
    grid.voxel_size = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double side = region.size()[axis] / grid.countAlong(axis);
        grid.voxel_size = std::max(grid.voxel_size, side / (BlockGrid::kResolution - 2 * margin[axis]));
    }
    Vec3d covered;
    for (int axis = 0; axis < 3; ++axis) {
        grid.core[axis] = roundedUp(region.size()[axis] / grid.countAlong(axis) / grid.voxel_size);
        // Fades at the two borders of a block must not meet.
        if (margin[axis] > 0) grid.core[axis] = std::max(grid.core[axis], roundedUp(2 * BlockGrid::kFade));
        covered[axis] = grid.voxel_size * grid.core[axis] * grid.countAlong(axis);
    }
    grid.origin = region.center() - 0.5 * covered;
    return grid;
}

}  // namespace nerfvdb
