// SPDX-License-Identifier: Apache-2.0
#include "trainer/scene_box.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "trainer/possible_cells.h"

namespace nerfvdb {
namespace {

constexpr int kSearchResolution = 64;

/// Bounds of the cells, in world units, with one cell of margin.
Box boundsOf(const BoxGrid& grid, const std::vector<Topology::LeafCells>& leaves) {
    Vec3i lower = grid.dims, upper = -Vec3i::Ones();
    for (const Topology::LeafCells& entry : leaves)
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            if (!testBit(entry.cells, offset)) continue;
            const Vec3i cell = entry.leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            lower = lower.cwiseMin(cell);
            upper = upper.cwiseMax(cell);
        }
    return {grid.frame.worldFromIndex((lower - Vec3i::Ones()).cast<double>()),
            grid.frame.worldFromIndex((upper + Vec3i::Constant(2)).cast<double>())};
}

Box cubeAround(const Vec3d& center, double half) {
    return {center - Vec3d::Constant(half), center + Vec3d::Constant(half)};
}

}  // namespace

Vec3d commonFocus(const Dataset& dataset) {
    Mat3d normal = Mat3d::Zero();
    Vec3d right = Vec3d::Zero(), mean = Vec3d::Zero();
    for (const View& view : dataset.views) {
        const Vec3d axis = -view.camera.world_from_camera.col(2);
        const Mat3d across = Mat3d::Identity() - axis * axis.transpose();
        normal += across;
        right += across * view.camera.position;
        mean += view.camera.position / static_cast<double>(dataset.views.size());
    }
    const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(normal);
    constexpr double kParallel = 1e-3;  // axes within about 2 degrees of each other meet nowhere reliable
    if (eigen.eigenvalues().minCoeff() < kParallel * static_cast<double>(dataset.views.size())) return mean;
    return normal.ldlt().solve(right);
}

Box findSceneBox(const Dataset& dataset, const std::optional<Box>& given) {
    if (given) {
        if (!given->min.allFinite() || !given->max.allFinite() || (given->size().array() <= 0).any())
            throw UsageError("--bounds", "a box that is empty or not finite", "min < max on every axis",
                             "give x0 y0 z0 x1 y1 z1 in world units");
        return *given;
    }
    if (dataset.aabb_scale) return sceneBoxFromAabbScale(*dataset.aabb_scale);

    const Vec3d focus = commonFocus(dataset);
    double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
    for (const View& view : dataset.views) {
        nearest = std::min(nearest, (view.camera.position - focus).norm());
        farthest = std::max(farthest, (view.camera.position - focus).norm());
    }
    if (!dataset.has_alpha) return cubeAround(focus, farthest > 0 ? farthest : 1.0);

    // The hull inside the cameras' ring, again and again: each search looks at the last one's finding only. Space
    // that few views see whole (behind the object, at the edges of the pictures) is no part of what was captured.
    const std::size_t min_views = (dataset.views.size() + 1) / 2;
    Box box = cubeAround(focus, nearest > 0 ? nearest : 1.0);
    for (int pass = 0; pass < 3; ++pass) {
        const BoxGrid grid = gridOver(box, kSearchResolution);
        const std::vector<Topology::LeafCells> cells = possibleCells(dataset, grid, min_views);
        if (cells.empty())
            throw DataError(dataset.root.string(), "alpha masks that agree on no point of space",
                            "an object that every mask shows", "check the poses, or give --bounds");
        box = boundsOf(grid, cells);
    }
    return box;
}

}  // namespace nerfvdb
