// SPDX-License-Identifier: Apache-2.0
#include "trainer/ray_source.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/random.h"

namespace nerfvdb {
namespace {

constexpr int kTilePixels = 8;

int tilesAlong(int pixels) { return (pixels + kTilePixels - 1) / kTilePixels; }

}  // namespace

void RaySource::update(const VoxelField& field, const Occupancy& occupancy) {
    // A leaf stands for its bounding sphere: 8 voxels plus the upper corners of its last cells.
    std::vector<Vec3d> centers;
    for (std::size_t leaf = 0; leaf < occupancy.cells.size(); ++leaf) {
        const LeafMask& cells = occupancy.cells[leaf];
        if (std::all_of(cells.begin(), cells.end(), [](std::uint64_t word) { return word == 0; })) continue;
        centers.push_back(field.frame().worldFromIndex(
            (field.topology().leafCoords()[leaf] * kLeafDim).cast<double>() + Vec3d::Constant(0.5 * kLeafDim)));
    }
    const double radius = 0.5 * std::sqrt(3.0) * kLeafDim * field.frame().voxel_size;

    std::vector<std::vector<Tile>> found(dataset_->views.size());
    parallelFor(found.size(), [&](std::size_t v) {
        const Camera& camera = dataset_->views[v].camera;
        const int tiles_x = tilesAlong(camera.width), tiles_y = tilesAlong(camera.height);
        std::vector<std::uint8_t> is_live(static_cast<std::size_t>(tiles_x) * tiles_y, 0);
        bool all = false;
        for (const Vec3d& center : centers) {
            const std::optional<PixelDisc> disc = projectSphere(camera, center, radius);
            if (!disc) {
                // So near the camera that it may cover anything, unless it lies behind.
                const Vec3d offset = center - camera.position;
                all = all || (offset.norm() < 3 * radius && camera.world_from_camera.col(2).dot(offset) <= radius);
                continue;
            }
            const auto tileAt = [](double pixel, int lowest, int highest) {
                return static_cast<int>(std::clamp<double>(std::floor(pixel / kTilePixels), lowest, highest));
            };
            const int x0 = tileAt(disc->center.x() - disc->radius, 0, tiles_x);
            const int x1 = tileAt(disc->center.x() + disc->radius, -1, tiles_x - 1);
            const int y0 = tileAt(disc->center.y() - disc->radius, 0, tiles_y);
            const int y1 = tileAt(disc->center.y() + disc->radius, -1, tiles_y - 1);
            for (int y = y0; y <= y1; ++y)
                for (int x = x0; x <= x1; ++x) is_live[static_cast<std::size_t>(y) * tiles_x + x] = 1;
        }
        for (int y = 0; y < tiles_y; ++y)
            for (int x = 0; x < tiles_x; ++x)
                if (all || is_live[static_cast<std::size_t>(y) * tiles_x + x])
                    found[v].push_back({static_cast<std::uint16_t>(v), static_cast<std::uint16_t>(x),
                                        static_cast<std::uint16_t>(y)});
    });
    tiles_.clear();
    for (const std::vector<Tile>& tiles : found) tiles_.insert(tiles_.end(), tiles.begin(), tiles.end());
}

RaySource::Pick RaySource::pick(std::uint64_t step, std::uint64_t index) const {
    const std::uint64_t bits = randomBits(seed_, step, index);
    const Tile& tile = tiles_[(bits >> 32) * tiles_.size() >> 32];
    const Camera& camera = dataset_->views[tile.view].camera;
    const int x0 = tile.x * kTilePixels, y0 = tile.y * kTilePixels;
    const int width = std::min(kTilePixels, camera.width - x0);
    const int height = std::min(kTilePixels, camera.height - y0);
    const std::uint64_t more = mixBits(bits);
    return {tile.view, x0 + static_cast<int>((more & 0xffff) * static_cast<unsigned>(width) >> 16),
            y0 + static_cast<int>((more >> 16 & 0xffff) * static_cast<unsigned>(height) >> 16), more};
}

void RaySource::prefetch(std::uint64_t step, std::uint64_t index) const {
    const Pick picked = pick(step, index);
    const View& view = dataset_->views[picked.view];
    __builtin_prefetch(&view.photo.pixels[static_cast<std::size_t>(picked.y) * view.camera.width + picked.x]);
}

TrainingRay RaySource::draw(std::uint64_t step, std::uint64_t index) const {
    const Pick picked = pick(step, index);
    const View& view = dataset_->views[picked.view];
    TrainingRay drawn;
    drawn.ray = cameraRay(view.camera, picked.x + 0.5, picked.y + 0.5);
    drawn.jitter = unitFloat(static_cast<std::uint32_t>(picked.bits >> 32));
    const auto& pixel = view.photo.pixels[static_cast<std::size_t>(picked.y) * view.camera.width + picked.x];
    for (int c = 0; c < 4; ++c) drawn.rgba[c] = static_cast<float>(pixel[c]) * (1.0f / 255.0f);
    drawn.bits = mixBits(picked.bits);
    drawn.view = picked.view;
    drawn.x = picked.x;
    drawn.y = picked.y;
    return drawn;
}

}  // namespace nerfvdb
