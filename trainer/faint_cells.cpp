// SPDX-License-Identifier: Apache-2.0
#include "trainer/faint_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/parallel.h"
#include "vdb/occupancy.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

constexpr int kRays = 4096;
constexpr int kTileRays = 256;
/// From 1e-2 down to 1e-5: small steps, so that chance does not decide between two that end far apart.
constexpr auto kMinAlphas = [] {
    std::array<float, 25> alphas{1e-2f};
    for (std::size_t k = 1; k < alphas.size(); ++k) alphas[k] = 0.75f * alphas[k - 1];
    return alphas;
}();
constexpr std::uint64_t kStream = std::uint64_t{1} << 62;  // steps that no training step has: other rays

/// The largest raw density of a cell's corners: what findOccupied judges it by.
float densestCorner(const Bricks& bricks, std::int32_t leaf, std::int32_t cell) {
    float most = -std::numeric_limits<float>::infinity();
    for (int corner = 0; corner < 8; ++corner)
        most = std::max(most, bricks.density[cornerIndex(bricks, leaf, cell, corner)]);
    return most;
}

/// What a tile of rays has below each threshold.
struct TileLight {
    std::array<std::vector<float>, kMinAlphas.size()> hidden;  // of each ray that meets something: light in such cells
    std::array<double, kMinAlphas.size()> passed{};            // more light behind all rays without them
};

TileLight lightOf(const TraceScene& scene, const TraceOptions& options, const RaySource& source, std::uint64_t step, int first,
                  const std::array<float, kMinAlphas.size()>& min_raw) {
    RayTracer tracer(kTileRays);
    KeptSamples kept;
    source.boundMapped();
    for (int r = 0; r < kTileRays; ++r) {
        const TrainingRay drawn = source.draw(kStream + step, static_cast<std::uint64_t>(first + r));
        tracer.addRay(scene, drawn.ray, options.step_voxels, drawn.jitter);
    }
    tracer.trace(scene, options, kept);
    std::array<std::array<float, kTileRays>, kMinAlphas.size()> weights{}, taus{};
    for (int i = 0; i < kept.n; ++i) {
        const float raw = densestCorner(scene.bricks, kept.leaf[i], kept.cell[i]);
        const auto end = std::partition_point(min_raw.begin(), min_raw.end(), [raw](float m) { return raw < m; });
        if (end == min_raw.begin()) continue;
        const auto k = static_cast<std::size_t>(end - min_raw.begin() - 1), r = static_cast<std::size_t>(kept.ray[i]);
        weights[k][r] += kept.weight[i];
        taus[k][r] += kept.tau[i];
    }
    // What hides below a threshold hides below every larger one.
    for (std::size_t k = kMinAlphas.size() - 1; k > 0; --k)
        for (std::size_t r = 0; r < kTileRays; ++r) {
            weights[k - 1][r] += weights[k][r];
            taus[k - 1][r] += taus[k][r];
        }
    TileLight light;
    for (std::size_t k = 0; k < kMinAlphas.size(); ++k)
        for (const std::int32_t ray : tracer.litRays()) {
            const auto r = static_cast<std::size_t>(ray);
            light.hidden[k].push_back(weights[k][r]);
            light.passed[k] += tracer.transmittance()[r] * std::expm1(static_cast<double>(taus[k][r]));
        }
    return light;
}

}  // namespace

float chooseMinAlpha(const VoxelField& field, const RaySource& source, std::uint64_t step) {
    if (source.tileCount() == 0) return kMinAlphas.front();
    const Occupancy everything = findOccupied(field, kMinAlphas.back());
    const TraceScene scene(field, everything);
    TraceOptions all_weights;
    all_weights.min_weight = all_weights.max_dropped = 0;
    std::array<float, kMinAlphas.size()> min_raw;
    for (std::size_t k = 0; k < kMinAlphas.size(); ++k) min_raw[k] = rawFromVoxelAlpha(field, kMinAlphas[k]);

    std::array<TileLight, kRays / kTileRays> tiles;
    parallelFor(tiles.size(), [&](std::size_t t) {
        tiles[t] = lightOf(scene, all_weights, source, step, static_cast<int>(t) * kTileRays, min_raw);
    });
    std::size_t n_rays = 0;
    for (const TileLight& tile : tiles) n_rays += tile.hidden.front().size();
    if (n_rays == 0) return kMinAlphas.front();

    const auto rays = static_cast<double>(n_rays);
    for (std::size_t k = 0; k < kMinAlphas.size(); ++k) {
        std::ptrdiff_t beyond = 0;
        double passed = 0;
        for (const TileLight& tile : tiles) {
            const std::vector<float>& hidden = tile.hidden[k];
            beyond += std::count_if(hidden.begin(), hidden.end(), [](float h) { return h > kMostHidden; });
            passed += tile.passed[k];
        }
        if (static_cast<double>(beyond) <= kRaysBeyond * rays && passed <= kMostPassed * rays) return kMinAlphas[k];
    }
    return kMinAlphas.back();
}

}  // namespace nerfvdb
