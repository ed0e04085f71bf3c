// SPDX-License-Identifier: Apache-2.0
#include "bench/gradient_order.h"

#include <algorithm>

#include "bench/training_probe.h"
#include "core/parallel.h"
#include "core/random.h"
#include "vdb/leaf_scatter.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

constexpr int kTileRays = 256;
constexpr RmsPropRates kStill = {0, 0, 0.95f, 1e-4f, 0.01f, 0.03f, 0.2f};

float noise(std::uint64_t stream, std::uint64_t index) {
    return 2 * unitFloat(static_cast<std::uint32_t>(randomBits(21, stream, index))) - 1;
}

/// Samples of a batch of training rays with gradients of noise: what they are does not change the work.
std::vector<TileGradients> noisyTiles(TrainingProbe& probe, int batch) {
    const TrainState& state = probe.state();
    const TraceScene scene(state.field, state.occupancy);
    const TraceOptions options;
    RayTracer tracer(kTileRays);
    std::vector<TileGradients> tiles(static_cast<std::size_t>((batch + kTileRays - 1) / kTileRays));
    for (std::size_t t = 0; t < tiles.size(); ++t) {
        tracer.clear();
        for (int r = 0; r < std::min(kTileRays, batch - static_cast<int>(t) * kTileRays); ++r) {
            const TrainingRay drawn = probe.source().draw(0, t * kTileRays + r);
            tracer.addRay(scene, drawn.ray, options.step_voxels, drawn.jitter);
        }
        tracer.trace(scene, options, tiles[t].kept);
        for (int i = 0; i < tiles[t].kept.n; ++i) tiles[t].kept.dl_draw[i] = noise(t, i);
        tiles[t].dl_dray_features.resize(static_cast<std::size_t>(kTileRays) * state.field.channels());
        for (std::size_t i = 0; i < tiles[t].dl_dray_features.size(); ++i)
            tiles[t].dl_dray_features[i] = noise(t + tiles.size(), i);
    }
    return tiles;
}

/// Gradients of a whole field, and which leaves have any.
struct GradientPool {
    explicit GradientPool(const VoxelField& field)
        : density(field.density().size()), features(field.features().size()), touched(field.topology().leafCount()),
          is_touched(touched.size(), 0) {}

    void add(const Bricks& bricks, const TileGradients& tile) {
        const auto channels = static_cast<std::size_t>(bricks.channels);
        const KeptSamples& kept = tile.kept;
        for (int i = 0; i < kept.n; ++i) {
            const float* const dl_dfeatures = &tile.dl_dray_features[kept.ray[i] * channels];
            for (int corner = 0; corner < 8; ++corner) {
                const float share = (corner & 4 ? kept.x[i] : 1 - kept.x[i]) * (corner & 2 ? kept.y[i] : 1 - kept.y[i]) *
                                    (corner & 1 ? kept.z[i] : 1 - kept.z[i]);
                const std::size_t voxel = cornerIndex(bricks, kept.leaf[i], kept.cell[i], corner);
                density[voxel] += share * kept.dl_draw[i];
                const float weight = share * kept.weight[i];
                float* const row = &features[voxel * channels];
                for (std::size_t c = 0; c < channels; ++c) row[c] += weight * dl_dfeatures[c];
                const std::size_t leaf = voxel / kLeafVoxels;
                setBit(touched[leaf], static_cast<int>(voxel % kLeafVoxels));
                if (!is_touched[leaf]) leaves.push_back(leaf);
                is_touched[leaf] = 1;
            }
        }
    }

    HugeArray<float> density, features;
    std::vector<LeafMask> touched;
    std::vector<std::uint8_t> is_touched;
    std::vector<std::size_t> leaves;
};

}  // namespace

GradientOrder timeGradientOrder(const Model& model, const Dataset& dataset, int batch, int repeats, Report& report) {
    const ThreadLimit one(1);
    TrainingProbe probe(model, dataset);
    TrainState& state = probe.state();
    const VoxelField& field = state.field;
    const int channels = field.channels();
    const Bricks bricks = bricksOf(field, state.occupancy);
    std::vector<TileGradients> tiles = noisyTiles(probe, batch);
    LeafScatter scatter;
    GradientPool pool(field);
    const auto move = [&](std::size_t leaf, const LeafGradient& gradient) {
        const std::size_t first = leaf * kLeafVoxels;
        simd::rmsPropLeaf(channels, kStill, field.topology().voxels()[leaf].data(), gradient,
                          &state.field.density()[first], &state.density_moment[first],
                          &state.field.features()[first * channels], &state.feature_moment[first]);
    };
    const auto expect = [&](std::size_t leaf, const LeafGradient& gradient) {
        const std::size_t first = leaf * kLeafVoxels;
        simd::prefetchLeaf(channels, kStill, field.topology().voxels()[leaf].data(), gradient,
                           &state.field.density()[first], &state.density_moment[first],
                           &state.field.features()[first * channels], &state.feature_moment[first]);
    };
    const auto pooled = [&](std::size_t leaf) {
        const std::size_t first = leaf * kLeafVoxels;
        return LeafGradient{&pool.density[first], &pool.features[first * channels], pool.touched[leaf].data()};
    };
    const std::vector<std::function<void()>> bodies = {
        [&] {
            for (TileGradients& tile : tiles) tile.bin(field.topology(), channels);
            scatter.run(
                field.topology(), channels, tiles,
                [&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask&) {
                    move(static_cast<std::size_t>(leaf), gradient);
                },
                /*min_seen=*/0,
                [&](std::int32_t leaf, const LeafGradient& gradient) {
                    expect(static_cast<std::size_t>(leaf), gradient);
                });
        },
        [&] {
            for (const TileGradients& tile : tiles) pool.add(bricks, tile);
            for (std::size_t i = 0; i < pool.leaves.size(); ++i) {
                if (i + 1 < pool.leaves.size()) expect(pool.leaves[i + 1], pooled(pool.leaves[i + 1]));
                move(pool.leaves[i], pooled(pool.leaves[i]));
                pool.is_touched[pool.leaves[i]] = 0;
            }
            pool.leaves.clear();
        }};
    std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = repeats, .min_sample_s = 0.05}, "order of gradients", report);
    return {std::move(timings[0]), std::move(timings[1])};
}

}  // namespace nerfvdb
