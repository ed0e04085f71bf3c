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
                row += photo.at(x, y)[3] > 0;
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
    return gridOfVoxels(box, box.size().maxCoeff() / (resolution - 1));
}

BoxGrid gridOfVoxels(const Box& box, double voxel_size) {
    BoxGrid grid;
    const Vec3d size = box.size();
    grid.frame.voxel_size = voxel_size;
    for (int axis = 0; axis < 3; ++axis) {
        const int voxels = static_cast<int>(std::ceil(size[axis] / grid.frame.voxel_size - 1e-6)) + 1;
        grid.dims[axis] = (voxels + kLeafDim - 1) / kLeafDim * kLeafDim;
    }
    const Vec3d covered = grid.frame.voxel_size * (grid.dims - Vec3i::Ones()).cast<double>();
    grid.frame.origin = box.center() - 0.5 * covered;
    grid.shells.extent = grid.dims - Vec3i::Ones();
    return grid;
}

BoxGrid gridAround(const Box& box, double voxel_size, int shells) {
    constexpr int kMultiple = 8;  // what a shell leaves out ends between its cells, now and at every finer voxel size
    constexpr int kGap = 16;      // between shells: a leaf of a model's preview
    BoxGrid grid;
    const Vec3d size = box.size();
    grid.frame.voxel_size = voxel_size;
    for (int axis = 0; axis < 3; ++axis)
        grid.shells.extent[axis] =
            static_cast<int>(std::ceil(size[axis] / grid.frame.voxel_size / kMultiple - 1e-6)) * kMultiple;
    grid.shells.count = shells;
    grid.shells.stride = (grid.shells.extent.x() + 2 * kGap - 1) / kGap * kGap;
    grid.dims = grid.shells.extent + Vec3i::Constant(kLeafDim);
    grid.dims.x() = shells * grid.shells.stride;
    grid.frame.origin = box.center() - 0.5 * grid.frame.voxel_size * grid.shells.extent.cast<double>();
    return grid;
}

namespace {

/// Whether a cell of shells exists at all: inside its shell's box and outside what the next smaller one covers.
bool isOwnCell(const Shells& shells, int shell, const Vec3i& cell) {
    const Vec3i local = cell - Vec3i(shell * shells.stride, 0, 0);
    if ((local.array() < 0).any() || (local.array() >= shells.extent.array()).any()) return false;
    const Vec3i hole = shells.extent / 4;
    return shell == 0 || (local.array() < hole.array()).any() || (local.array() >= 3 * hole.array()).any();
}

/// Whether so many cameras have a point in their picture, and none stands next to it.
bool isInViewOf(const Dataset& dataset, std::size_t min_views, const Vec3d& point, double nearest) {
    std::size_t n_seen = 0;
    for (const View& view : dataset.views) {
        const Camera& camera = view.camera;
        if ((point - camera.position).squaredNorm() < nearest * nearest) return false;
        if (n_seen >= min_views) continue;
        const std::optional<Vec2d> pixel = projectPoint(camera, point);
        n_seen += pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < camera.width && pixel->y() < camera.height;
    }
    return n_seen >= min_views;
}

}  // namespace

std::vector<Topology::LeafCells> possibleCells(const Dataset& dataset, const BoxGrid& grid,
                                               std::size_t min_views) {
    std::vector<AlphaTable> alpha;
    if (dataset.has_alpha) {
        std::vector<std::optional<AlphaTable>> tables(dataset.views.size());
        parallelFor(tables.size(), [&](std::size_t v) { tables[v].emplace(dataset.views[v].photo); });
        for (auto& table : tables) alpha.push_back(std::move(*table));
    }
    const double radius = 0.5 * std::sqrt(3.0) * grid.frame.voxel_size;
    constexpr double kCarved = 0.01;  // of the inner box's longest side, around each camera
    const double nearest = kCarved * grid.frame.voxel_size * grid.shells.extent.maxCoeff();
    const Vec3i leaves = grid.dims / kLeafDim;
    std::vector<Topology::LeafCells> cells(static_cast<std::size_t>(leaves.prod()));
    parallelFor(cells.size(), [&](std::size_t n) {
        const int i = static_cast<int>(n);
        cells[n].leaf = Vec3i(i / (leaves.y() * leaves.z()), i / leaves.z() % leaves.y(), i % leaves.z());
        cells[n].cells = {};
        const int shell = grid.shells.shellOf(cells[n].leaf.x() * kLeafDim);
        const GridFrame frame = grid.shells.frame(grid.frame, shell);
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i cell = cells[n].leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if (!isOwnCell(grid.shells, shell, cell)) continue;
            const Vec3d center = frame.worldFromIndex(cell.cast<double>() + Vec3d::Constant(0.5));
            if (grid.shells.count > 1) {
                if (isInViewOf(dataset, min_views, center, nearest)) setBit(cells[n].cells, offset);
                continue;
            }
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

SceneShells findSceneShells(const Dataset& dataset, const std::optional<Box>& given) {
    const Vec3d focus = commonFocus(dataset);
    Box cameras{Vec3d::Constant(std::numeric_limits<double>::infinity()),
                Vec3d::Constant(-std::numeric_limits<double>::infinity())};
    std::vector<double> distances, focal_lengths;
    std::size_t n_inward = 0;
    for (const View& view : dataset.views) {
        cameras.min = cameras.min.cwiseMin(view.camera.position);
        cameras.max = cameras.max.cwiseMax(view.camera.position);
        const Vec3d to_focus = focus - view.camera.position;
        distances.push_back(to_focus.norm());
        focal_lengths.push_back(view.camera.fx);
        n_inward += -view.camera.world_from_camera.col(2).dot(to_focus) > 0;
    }
    const auto median = [](std::vector<double>& values) {
        std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
        return values[values.size() / 2];
    };
    const double distance = median(distances), focal_length = median(focal_lengths);
    const double spread = cameras.size().norm();

    SceneShells scene;
    constexpr double kInward = 0.9;  // of the cameras: they look at something in their middle
    const bool is_inward = static_cast<double>(n_inward) >= kInward * static_cast<double>(dataset.views.size());
    if (given) scene.inner = findSceneBox(dataset, given);
    else if (is_inward && distance > 0) scene.inner = cubeAround(focus, 0.5 * distance);
    else {
        const double margin = 0.1 * cameras.size().maxCoeff();
        scene.inner = {cameras.min - Vec3d::Constant(margin), cameras.max + Vec3d::Constant(margin)};
    }
    constexpr double kFewPixels = 8;
    constexpr int kMostShells = 8;
    const double reach = spread * focal_length / kFewPixels, half = 0.5 * scene.inner.size().maxCoeff();
    scene.count = 1;
    while (scene.count < kMostShells && half * Shells::scale(scene.count - 1) < reach) ++scene.count;
    return scene;
}

}  // namespace nerfvdb
