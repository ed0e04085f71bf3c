// SPDX-License-Identifier: Apache-2.0
#include "trainer/faint_cells.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "vdb/occupancy.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

constexpr int kRays = 1024;
constexpr int kTileRays = 256;
constexpr std::array<float, 10> kMinAlphas = {1e-2f, 5e-3f, 2e-3f, 1e-3f, 5e-4f, 2e-4f, 1e-4f, 5e-5f, 2e-5f, 1e-5f};
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

    // hidden[k][ray]: light in cells below the k-th threshold.
    std::array<std::vector<float>, kMinAlphas.size()> hidden;
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
        std::array<std::array<float, kTileRays>, kMinAlphas.size()> sums{};
        for (int i = 0; i < kept.n; ++i) {
            const float raw = densestCorner(scene.bricks, kept.leaf[i], kept.cell[i]);
            for (std::size_t k = 0; k < kMinAlphas.size() && raw < min_raw[k]; ++k)
                sums[k][static_cast<std::size_t>(kept.ray[i])] += kept.weight[i];
        }
        for (std::size_t k = 0; k < kMinAlphas.size(); ++k)
            for (const std::int32_t r : tracer.litRays()) hidden[k].push_back(sums[k][static_cast<std::size_t>(r)]);
    }
    if (hidden[0].empty()) return kMinAlphas.front();

    for (std::size_t k = 0; k < kMinAlphas.size(); ++k) {
        const auto beyond = std::count_if(hidden[k].begin(), hidden[k].end(), [](float h) { return h > kMostHidden; });
        if (static_cast<double>(beyond) <= kRaysBeyond * static_cast<double>(hidden[k].size())) return kMinAlphas[k];
    }
    return kMinAlphas.back();
}

}  // namespace nerfvdb
