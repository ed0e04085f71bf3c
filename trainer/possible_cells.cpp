// SPDX-License-Identifier: Apache-2.0
#include "trainer/possible_cells.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/parallel.h"
#include "core/photo_cache.h"

namespace nerfvdb {
namespace {

/// Whether a rectangle of a photograph has a pixel that is not transparent: a bit a pixel, in blocks of 8x8, and how
/// many blocks above and left of a block have one.
class AlphaTable {
public:
    explicit AlphaTable(const Photo& photo)
        : width_((photo.width + 7) / 8), height_((photo.height + 7) / 8),
          blocks_(static_cast<std::size_t>(width_) * height_),
          sums_(static_cast<std::size_t>(width_ + 1) * (height_ + 1)) {
        for (int y = 0; y < photo.height; ++y)
            for (int x = 0; x < photo.width; ++x)
                if (photo.at(x, y)[3] > 0) blocks_[block(x / 8, y / 8)] |= std::uint64_t{1} << ((y & 7) * 8 + (x & 7));
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x)
                sums_[sum(x + 1, y + 1)] =
                    sums_[sum(x, y + 1)] + sums_[sum(x + 1, y)] - sums_[sum(x, y)] + (blocks_[block(x, y)] != 0);
        releasePages(photo);
    }
    /// Pixels from (x0, y0) to before (x1, y1), all in the photograph, and at least one.
    bool hasAny(int x0, int y0, int x1, int y1) const {
        // Whole blocks ...
        const int left = (x0 + 7) / 8, top = (y0 + 7) / 8, right = x1 / 8, bottom = y1 / 8;
        if (left < right && top < bottom &&
            sums_[sum(right, bottom)] + sums_[sum(left, top)] != sums_[sum(left, bottom)] + sums_[sum(right, top)])
            return true;
        // ... and those on the border, in part.
        for (int y = y0 / 8; y <= (y1 - 1) / 8; ++y) {
            const bool is_whole_row = y >= top && y < bottom;
            for (int x = x0 / 8; x <= (x1 - 1) / 8; ++x) {
                if (is_whole_row && x >= left && x < right) x = right;  // to what lies behind the whole ones
                if (x > (x1 - 1) / 8) break;
                if (blocks_[block(x, y)] & part(x0 - 8 * x, x1 - 8 * x, y0 - 8 * y, y1 - 8 * y)) return true;
            }
        }
        return false;
    }

private:
    std::size_t block(int x, int y) const { return static_cast<std::size_t>(y) * width_ + x; }
    std::size_t sum(int x, int y) const { return static_cast<std::size_t>(y) * (width_ + 1) + x; }
    /// Bits of the pixels from (x0, y0) to before (x1, y1) of a block.
    static std::uint64_t part(int x0, int x1, int y0, int y1) {
        x0 = std::max(x0, 0), y0 = std::max(y0, 0), x1 = std::min(x1, 8), y1 = std::min(y1, 8);
        const std::uint64_t row = (std::uint64_t{1} << x1) - (std::uint64_t{1} << x0);
        std::uint64_t bits = 0;
        for (int y = y0; y < y1; ++y) bits |= row << 8 * y;
        return bits;
    }
    int width_, height_;  // in blocks
    std::vector<std::uint64_t> blocks_;
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
    if (alpha && !alpha->hasAny(x0, y0, x1, y1)) return Sight::empty;
    return Sight::filled;
}

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
        const int shell = grid.shells.layerAt(cells[n].leaf.x() * kLeafDim);
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

}  // namespace nerfvdb
