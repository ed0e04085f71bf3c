// SPDX-License-Identifier: Apache-2.0
#include "trainer/ray_source.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/photo_cache.h"
#include "core/prefetch.h"
#include "core/random.h"

namespace nerfvdb {
namespace {

constexpr int kTilePixels = PixelMask::kTile;

constexpr std::uint64_t kAgain = 0x9e3779b97f4a7c15;  // odd, and unlike what draw makes of the same bits

int tilesAlong(int pixels) { return (pixels + kTilePixels - 1) / kTilePixels; }

}  // namespace

void RaySource::update(const VoxelField& field, const Occupancy& occupancy) {
    // A leaf stands for its bounding sphere: 8 voxels plus the upper corners of its last cells.
    struct Sphere {
        Vec3d center;
        double radius;
    };
    const Shells& shells = field.shells();
    std::vector<Sphere> spheres;
    for (std::size_t leaf = 0; leaf < occupancy.cells.size(); ++leaf) {
        const LeafMask& cells = occupancy.cells[leaf];
        if (std::all_of(cells.begin(), cells.end(), [](std::uint64_t word) { return word == 0; })) continue;
        const Vec3i first = field.topology().leafCoords()[leaf] * kLeafDim;
        const GridFrame frame = shells.frame(field.frame(), shells.layerAt(first.x()));
        spheres.push_back({frame.worldFromIndex(first.cast<double>() + Vec3d::Constant(0.5 * kLeafDim)),
                           0.5 * std::sqrt(3.0) * kLeafDim * frame.voxel_size});
    }

    std::vector<std::vector<Tile>> found(dataset_->views.size());
    parallelFor(found.size(), [&](std::size_t v) {
        const Camera& camera = dataset_->views[v].camera;
        const int tiles_x = tilesAlong(camera.width), tiles_y = tilesAlong(camera.height);
        std::vector<std::uint8_t> is_live(static_cast<std::size_t>(tiles_x) * tiles_y, 0);
        bool all = false;
        for (const auto& [center, radius] : spheres) {
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
        const PixelMask& mask = dataset_->views[v].mask;
        for (int y = 0; y < tiles_y; ++y)
            for (int x = 0; x < tiles_x; ++x)
                if ((all || is_live[static_cast<std::size_t>(y) * tiles_x + x]) && (mask.empty() || mask.tile(x, y) != 0))
                    found[v].push_back({static_cast<std::uint16_t>(v), static_cast<std::uint16_t>(x),
                                        static_cast<std::uint16_t>(y)});
    });
    tiles_.clear();
    for (const std::vector<Tile>& tiles : found) tiles_.insert(tiles_.end(), tiles.begin(), tiles.end());
}

void RaySource::useAll() {
    tiles_.clear();
    for (std::size_t v = 0; v < dataset_->views.size(); ++v)
        for (int y = 0; y < tilesAlong(dataset_->views[v].camera.height); ++y)
            for (int x = 0; x < tilesAlong(dataset_->views[v].camera.width); ++x)
                tiles_.push_back({static_cast<std::uint16_t>(v), static_cast<std::uint16_t>(x),
                                  static_cast<std::uint16_t>(y)});
}

void RaySource::boundMapped() const {
    if (!mapped_limit_ || mappedFileBytes() <= *mapped_limit_) return;
    for (const View& view : dataset_->views) releasePages(view.photo);
}

const RaySource::Tile& RaySource::tileOf(std::uint64_t bits) const { return tiles_[(bits >> 32) * tiles_.size() >> 32]; }

void RaySource::pick(std::uint64_t bits, TrainingRay& drawn) const {
    // Until a pixel is met that counts, so that all of them are drawn alike: each tile has one, it is soon met.
    for (;; bits = mixBits(bits + kAgain)) {
        const Tile& tile = tileOf(bits);
        const View& view = dataset_->views[tile.view];
        const int x0 = tile.x * kTilePixels, y0 = tile.y * kTilePixels;
        const int width = std::min(kTilePixels, view.camera.width - x0);
        const int height = std::min(kTilePixels, view.camera.height - y0);
        const std::uint64_t more = mixBits(bits);
        drawn.view = tile.view;
        drawn.x = x0 + static_cast<int>((more & 0xffff) * static_cast<unsigned>(width) >> 16);
        drawn.y = y0 + static_cast<int>((more >> 16 & 0xffff) * static_cast<unsigned>(height) >> 16);
        drawn.bits = more;
        if (view.mask.counts(drawn.x, drawn.y)) return;
    }
}

void RaySource::draw(std::uint64_t step, std::uint64_t first, std::span<TrainingRay> rays) const {
    // Both the tile and the pixel are somewhere in main memory: all of either are sent for before one is waited for.
    for (std::size_t i = 0; i < rays.size(); ++i) {
        rays[i].bits = randomBits(seed_, step, first + i);
        prefetch(&tileOf(rays[i].bits));
    }
    for (TrainingRay& drawn : rays) {
        pick(drawn.bits, drawn);
        prefetch(&dataset_->views[drawn.view].photo.at(drawn.x, drawn.y));
    }
    for (TrainingRay& drawn : rays) {
        const View& view = dataset_->views[drawn.view];
        drawn.ray = cameraRay(view.camera, drawn.x + 0.5, drawn.y + 0.5);
        drawn.jitter = unitFloat(static_cast<std::uint32_t>(drawn.bits >> 32));
        const Photo::Pixel& pixel = view.photo.at(drawn.x, drawn.y);
        for (int c = 0; c < 4; ++c) drawn.rgba[c] = static_cast<float>(pixel[c]) * (1.0f / 255.0f);
        drawn.bits = mixBits(drawn.bits);
    }
}

TrainingRay RaySource::draw(std::uint64_t step, std::uint64_t index) const {
    TrainingRay drawn;
    draw(step, index, {&drawn, 1});
    return drawn;
}

}  // namespace nerfvdb
