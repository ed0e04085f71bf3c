// SPDX-License-Identifier: Apache-2.0
#include "trainer/faint_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "vdb/occupancy.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

constexpr int kRays = 1024;
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

}  // namespace

float chooseMinAlpha(const VoxelField& field, const RaySource& source, std::uint64_t step) {
    if (source.tileCount() == 0) return kMinAlphas.front();
    const Occupancy everything = findOccupied(field, kMinAlphas.back());
    const TraceScene scene(field, everything);
    TraceOptions all_weights;
    all_weights.min_weight = all_weights.max_dropped = 0;

    std::array<float, kMinAlphas.size()> min_raw;
    for (std::size_t k = 0; k < kMinAlphas.size(); ++k) min_raw[k] = rawFromVoxelAlpha(field, kMinAlphas[k]);

    // hidden[k][ray]: light in cells below the k-th threshold; passed[k]: more light behind all rays without them.
    std::array<std::vector<float>, kMinAlphas.size()> hidden;
    std::array<double, kMinAlphas.size()> passed{};
    RayTracer tracer(kTileRays);
    KeptSamples kept;
    for (int first = 0; first < kRays; first += kTileRays) {
        tracer.clear();
        source.boundMapped();
        for (int r = 0; r < kTileRays; ++r) {
            const TrainingRay drawn = source.draw(kStream + step, static_cast<std::uint64_t>(first + r));
            tracer.addRay(scene, drawn.ray, all_weights.step_voxels, drawn.jitter);
        }
        tracer.trace(scene, all_weights, kept);
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
        for (std::size_t k = 0; k < kMinAlphas.size(); ++k)
            for (const std::int32_t ray : tracer.litRays()) {
                const auto r = static_cast<std::size_t>(ray);
                hidden[k].push_back(weights[k][r]);
                passed[k] += tracer.transmittance()[r] * std::expm1(static_cast<double>(taus[k][r]));
            }
    }
    if (hidden[0].empty()) return kMinAlphas.front();

    const auto rays = static_cast<double>(hidden[0].size());
    for (std::size_t k = 0; k < kMinAlphas.size(); ++k) {
        const auto beyond = std::count_if(hidden[k].begin(), hidden[k].end(), [](float h) { return h > kMostHidden; });
        if (static_cast<double>(beyond) <= kRaysBeyond * rays && passed[k] <= kMostPassed * rays) return kMinAlphas[k];
    }
    return kMinAlphas.back();
}

}  // namespace nerfvdb
