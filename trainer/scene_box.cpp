// SPDX-License-Identifier: Apache-2.0
#include "trainer/scene_box.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kSearchResolution = 64;

/// Number of pixels that are not fully transparent in any rectangle, in four reads (Crow 1984).
class AlphaTable {
public:
    explicit AlphaTable(const Photo& photo) : width_(photo.width), height_(photo.height) {
        sums_.assign(static_cast<std::size_t>(width_ + 1) * (height_ + 1), 0);
        for (int y = 0; y < height_; ++y) {
            std::uint32_t row = 0;
            for (int x = 0; x < width_; ++x) {
                row += photo.pixels[static_cast<std::size_t>(y) * width_ + x][3] > 0;
                at(x + 1, y + 1) = at(x + 1, y) + row;
            }
        }
    }
    /// Pixels [x0, x1) x [y0, y1), inside the image.
    std::uint32_t count(int x0, int y0, int x1, int y1) const {
        return at(x1, y1) - at(x0, y1) - at(x1, y0) + at(x0, y0);
    }

private:
    std::uint32_t& at(int x, int y) { return sums_[static_cast<std::size_t>(y) * (width_ + 1) + x]; }
    std::uint32_t at(int x, int y) const { return sums_[static_cast<std::size_t>(y) * (width_ + 1) + x]; }
    int width_, height_;
    std::vector<std::uint32_t> sums_;
};

enum class Sight { unseen, partly, empty, filled };

/// What a view says about a sphere.
Sight lookAtSphere(const Camera& camera, const AlphaTable* alpha, const Vec3d& center, double radius) {
    const std::optional<PixelDisc> disc = projectSphere(camera, center, radius);
    if (!disc) return Sight::partly;  // so near that its outline is no small circle, or out of sight
    const auto inReach = [](double pixel, int size) { return static_cast<int>(std::clamp(pixel, -1.0, size + 1.0)); };
    const int x0 = inReach(std::floor(disc->center.x() - disc->radius), camera.width);
    const int x1 = inReach(std::ceil(disc->center.x() + disc->radius), camera.width);
    const int y0 = inReach(std::floor(disc->center.y() - disc->radius), camera.height);
    const int y1 = inReach(std::ceil(disc->center.y() + disc->radius), camera.height);
    if (x1 <= 0 || y1 <= 0 || x0 >= camera.width || y0 >= camera.height) return Sight::unseen;
    if (x0 < 0 || y0 < 0 || x1 > camera.width || y1 > camera.height) return Sight::partly;
    if (alpha && alpha->count(x0, y0, x1, y1) == 0) return Sight::empty;
    return Sight::filled;
}

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

BoxGrid gridOver(const Box& box, int resolution) {
    BoxGrid grid;
    const Vec3d size = box.size();
    grid.frame.voxel_size = size.maxCoeff() / (resolution - 1);
    for (int axis = 0; axis < 3; ++axis) {
        const int voxels = static_cast<int>(std::ceil(size[axis] / grid.frame.voxel_size - 1e-6)) + 1;
        grid.dims[axis] = (voxels + kLeafDim - 1) / kLeafDim * kLeafDim;
    }
    const Vec3d covered = grid.frame.voxel_size * (grid.dims - Vec3i::Ones()).cast<double>();
    grid.frame.origin = box.center() - 0.5 * covered;
    return grid;
}

std::vector<Topology::LeafCells> possibleCells(const Dataset& dataset, const BoxGrid& grid,
                                               std::size_t min_views) {
    std::vector<AlphaTable> alpha;
    if (dataset.has_alpha) {
        std::vector<std::optional<AlphaTable>> tables(dataset.views.size());
        parallelFor(tables.size(), [&](std::size_t v) { tables[v].emplace(dataset.views[v].photo); });
        for (auto& table : tables) alpha.push_back(std::move(*table));
    }
    const double radius = 0.5 * std::sqrt(3.0) * grid.frame.voxel_size;
    const Vec3i leaves = grid.dims / kLeafDim;
    std::vector<Topology::LeafCells> cells(static_cast<std::size_t>(leaves.prod()));
    parallelFor(cells.size(), [&](std::size_t n) {
        const int i = static_cast<int>(n);
        cells[n].leaf = Vec3i(i / (leaves.y() * leaves.z()), i / leaves.z() % leaves.y(), i % leaves.z());
        cells[n].cells = {};
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i cell = cells[n].leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if ((cell.array() >= grid.dims.array() - 1).any()) continue;
            const Vec3d center = grid.frame.worldFromIndex(cell.cast<double>() + Vec3d::Constant(0.5));
            std::size_t n_seen = 0;
            bool is_empty = false;
            for (std::size_t v = 0; v < dataset.views.size() && !is_empty; ++v) {
                const Sight sight = lookAtSphere(dataset.views[v].camera, alpha.empty() ? nullptr : &alpha[v], center,
                                                 radius);
                n_seen += sight == Sight::filled;
                is_empty = sight == Sight::empty;
            }
            if (!is_empty && n_seen >= min_views) setBit(cells[n].cells, offset);
        }
    });
    std::erase_if(cells, [](const Topology::LeafCells& entry) {
        return std::all_of(entry.cells.begin(), entry.cells.end(), [](std::uint64_t word) { return word == 0; });
    });
    return cells;
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
