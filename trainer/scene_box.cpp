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

Box cubeAround(const Vec3d& center, double half) {
    return {center - Vec3d::Constant(half), center + Vec3d::Constant(half)};
}

/// How far cameras stand from their common focus; 1 where all stand in it.
struct Ring {
    Vec3d focus;
    double nearest, farthest;
};

Ring ringOf(const Dataset& dataset) {
    Ring ring{commonFocus(dataset), std::numeric_limits<double>::infinity(), 0};
    for (const View& view : dataset.views) {
        const double distance = (view.camera.position - ring.focus).norm();
        ring.nearest = std::min(ring.nearest, distance);
        ring.farthest = std::max(ring.farthest, distance);
    }
    if (!(ring.nearest > 0) || dataset.views.empty()) ring.nearest = 1;
    if (!(ring.farthest > 0)) ring.farthest = 1;
    return ring;
}

/// Bounds of what half of the views see whole, and no mask rules out, in a box; of nothing, none. Each search looks at the
/// last one's finding only. Space that few views see whole (behind the object, at the edges of the pictures) is no part of
/// what was captured.
std::optional<Box> boundsOfShared(const Dataset& dataset, Box box) {
    const std::size_t min_views = (dataset.views.size() + 1) / 2;
    for (int pass = 0; pass < 3; ++pass) {
        const BoxGrid grid = gridOver(box, kSearchResolution);
        const std::vector<Topology::LeafCells> cells = possibleCells(dataset, grid, min_views);
        if (cells.empty()) return std::nullopt;
        box = boundsOfCells(grid.frame, Topology(grid.dims, cells));
    }
    return box;
}

}  // namespace

Box boundsOfCells(const GridFrame& frame, const Topology& topology) {
    Vec3i lower = topology.dims(), upper = -Vec3i::Ones();
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.cells()[leaf], [&](int offset) {
            const Vec3i cell = topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            lower = lower.cwiseMin(cell);
            upper = upper.cwiseMax(cell);
        });
    return {frame.worldFromIndex((lower - Vec3i::Ones()).cast<double>()),
            frame.worldFromIndex((upper + Vec3i::Constant(2)).cast<double>())};
}

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

    const Ring ring = ringOf(dataset);
    if (!dataset.has_alpha) return cubeAround(ring.focus, ring.farthest);
    if (const std::optional<Box> hull = boundsOfShared(dataset, cubeAround(ring.focus, ring.nearest))) return *hull;
    throw DataError(dataset.root.string(), "alpha masks that agree on no point of space", "an object that every mask shows",
                    "check the poses, or give --bounds");
}

Box findCommonView(const Dataset& dataset) {
    const Ring ring = ringOf(dataset);
    const Box around = cubeAround(ring.focus, ring.farthest);
    return boundsOfShared(dataset, around).value_or(around);
}

Box boxOfCameras(const Dataset& dataset) {
    Box box{dataset.views.front().camera.position, dataset.views.front().camera.position};
    for (const View& view : dataset.views) {
        box.min = box.min.cwiseMin(view.camera.position);
        box.max = box.max.cwiseMax(view.camera.position);
    }
    return box;
}

bool isAtInfinity(const Vec3d& point, const Box& cameras) {
    const double farthest = 1e6 * cameras.size().norm();
    return !(farthest == 0 ? point.allFinite() : (point - cameras.center()).norm() <= farthest);
}

std::string leftOutAtInfinity(std::size_t n, std::size_t n_all) {
    return std::to_string(n) + " of " + std::to_string(n_all) +
           " points are not finite, or as good as infinitely far away, and are left out";
}

}  // namespace nerfvdb
