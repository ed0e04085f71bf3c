// SPDX-License-Identifier: Apache-2.0
#include "trainer/ray_source.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/possible_cells.h"

using namespace nerfvdb;

namespace {

constexpr int kSize = 24;

/// Half transparent everywhere: every pixel may see something.
VoxelField fullField(const Dataset& dataset) {
    const BoxGrid grid = gridOver({Vec3d::Constant(-3), Vec3d::Constant(3)}, 32);
    VoxelField field(Topology(grid.dims, possibleCells(dataset, grid, 0)), grid.frame, 8, 40.0);
    test::setDensity(field, [](const Vec3i&) { return -3.0f; });
    return field;
}

/// How often each pixel of each view is drawn.
std::vector<std::vector<int>> drawMany(const Dataset& dataset, int n_rays) {
    Dataset without_alpha = dataset;
    without_alpha.has_alpha = false;
    const VoxelField field = fullField(without_alpha);
    RaySource source(dataset, 3);
    source.update(field, findOccupied(field, 0.001f));
    std::vector<std::vector<int>> counts(dataset.views.size(), std::vector<int>(kSize * kSize));
    for (int i = 0; i < n_rays; ++i) {
        const TrainingRay drawn = source.draw(5, static_cast<std::uint64_t>(i));
        ++counts[static_cast<std::size_t>(drawn.view)][static_cast<std::size_t>(kSize * drawn.y + drawn.x)];
    }
    return counts;
}

}  // namespace

TEST_CASE("rays drawn together are those drawn one by one") {
    const Dataset dataset = test::sphereDataset(Split::train, 3, kSize);
    RaySource source(dataset, 3);
    source.useAll();
    std::vector<TrainingRay> together(300);
    source.draw(7, 100, together);
    for (std::size_t i = 0; i < together.size(); ++i) {
        const TrainingRay alone = source.draw(7, 100 + i);
        REQUIRE(together[i].view == alone.view);
        REQUIRE(together[i].x == alone.x);
        REQUIRE(together[i].y == alone.y);
        REQUIRE(together[i].bits == alone.bits);
        REQUIRE(together[i].jitter == alone.jitter);
        REQUIRE(together[i].rgba == alone.rgba);
        REQUIRE(together[i].ray.direction == alone.ray.direction);
    }
}

TEST_CASE("rays are drawn from pixels that count alone, and from all of those alike") {
    Dataset dataset = test::sphereDataset(Split::train, 3, kSize);
    PixelMask mask(kSize, kSize);
    std::size_t n_pixels = 2 * kSize * kSize;
    // One tile of a single pixel, one of none, stripes elsewhere.
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            const bool in_first = x < 8 && y < 8, in_second = x >= 8 && x < 16 && y < 8;
            if (in_second || (in_first ? (x != 3 || y != 4) : x % 3 == 0)) continue;
            mask.keep(x, y);
            ++n_pixels;
        }
    dataset.views[1].mask = mask;
    const int per_pixel = 100;
    const auto counts = drawMany(dataset, per_pixel * static_cast<int>(n_pixels));
    int drawn_masked = 0;
    double chi_squared = 0;
    for (std::size_t v = 0; v < 3; ++v)
        for (int i = 0; i < kSize * kSize; ++i) {
            const int n = counts[v][static_cast<std::size_t>(i)];
            if (dataset.views[v].mask.counts(i % kSize, i / kSize))
                chi_squared += (n - per_pixel) * (n - per_pixel) / static_cast<double>(per_pixel);
            else
                drawn_masked += n;
        }
    CHECK(drawn_masked == 0);
    // Of n degrees of freedom: mean n, standard deviation sqrt(2 n). The rays are always the same ones.
    const double n = static_cast<double>(n_pixels);
    CHECK(std::abs(chi_squared - n) < 4 * std::sqrt(2 * n));
}
