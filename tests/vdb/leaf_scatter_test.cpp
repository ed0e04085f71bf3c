// SPDX-License-Identifier: Apache-2.0
#include "vdb/leaf_scatter.h"

#include <atomic>
#include <cmath>
#include <cstring>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;
using test::randomIn;

namespace {

const Vec3i kDims(32, 24, 40);

/// Random samples in random cells of a field: `n_tiles` tiles of `n` samples on 20 rays, with random slopes.
std::vector<TileGradients> randomTiles(const VoxelField& field, int n_tiles, int n) {
    const Topology& topology = field.topology();
    const int channels = field.channels();
    std::vector<std::pair<std::int32_t, std::int32_t>> cells;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.cells()[leaf], [&](int offset) {
            cells.emplace_back(static_cast<std::int32_t>(leaf), static_cast<std::int32_t>(offset));
        });
    std::vector<TileGradients> tiles(n_tiles);
    for (int t = 0; t < n_tiles; ++t) {
        KeptSamples& kept = tiles[t].kept;
        kept.reserve(n);
        kept.n = n;
        for (int i = 0; i < n; ++i) {
            std::tie(kept.leaf[i], kept.cell[i]) = cells[randomBits(1, t, i) % cells.size()];
            kept.ray[i] = static_cast<std::int32_t>(randomBits(2, t, i) % 20);
            kept.x[i] = randomIn(0, 1, 3 + t, i), kept.y[i] = randomIn(0, 1, 4 + t, i);
            kept.z[i] = randomIn(0, 1, 5 + t, i), kept.weight[i] = randomIn(0, 1, 6 + t, i);
            kept.dl_draw[i] = randomIn(-1, 1, 7 + t, i);
        }
        for (int i = 0; i < 20 * channels + kPadding; ++i)
            tiles[t].dl_dray_features.push_back(randomIn(-1, 1, 8 + t, i));
        tiles[t].bin(topology, channels);
    }
    return tiles;
}

struct Gathered {
    std::vector<float> density, features;  // as in the field
    std::vector<LeafMask> touched, seen;
    int calls = 0;
};

Gathered scatterAll(const VoxelField& field, std::span<const TileGradients> tiles) {
    const std::size_t n_values = static_cast<std::size_t>(kLeafVoxels) * field.channels();
    Gathered all{std::vector<float>(field.density().size()), std::vector<float>(field.features().size()),
                 std::vector<LeafMask>(field.topology().leafCount()),
                 std::vector<LeafMask>(field.topology().leafCount())};
    std::atomic<int> calls = 0;
    LeafScatter scatter;
    for (int round = 0; round < 2; ++round)  // the second finds what the first left
        scatter.run(field.topology(), field.channels(), tiles,
                    [&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask& seen) {
                        std::memcpy(&all.density[leaf * std::size_t{kLeafVoxels}], gradient.density,
                                    kLeafVoxels * 4);
                        std::memcpy(&all.features[leaf * n_values], gradient.features, n_values * 4);
                        std::memcpy(&all.touched[leaf], gradient.touched, sizeof(LeafMask));
                        all.seen[leaf] = seen;
                        ++calls;
                        std::memset(gradient.density, 0, kLeafVoxels * 4);
                        std::memset(gradient.features, 0, n_values * 4);
                        std::memset(gradient.touched, 0, sizeof(LeafMask));
                    });
    all.calls = calls / 2;
    return all;
}

double dot(std::span<const float> a, std::span<const float> b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * b[i];
    return sum;
}

}  // namespace

TEST_CASE("scatter is the adjoint of read: <read(v), w> = <v, scatter(w)> for density and features") {
    for (const int channels : {4, 8, 16}) {
        CAPTURE(channels);
        const VoxelField field = test::randomField(kDims, channels, 0.3, -1.0f, 1.0f, 21);
        const Occupancy occupancy = occupancyFromCells(
            field.topology(), {field.topology().cells().begin(), field.topology().cells().end()});
        std::vector<TileGradients> tiles = randomTiles(field, 3, 500);

        double read_density = 0, read_features = 0, magnitude = 0;
        for (TileGradients& tile : tiles) {
            const std::size_t room = tile.kept.n + kPadding;
            std::vector<float> raw(room), tau(room), alpha(room), decay(room), features(room * channels),
                rays(20 * channels + kPadding);
            const Bricks bricks = bricksOf(field, occupancy);
            simd::densityForward(bricks, tile.kept.n, tile.kept.arrays(), 15.0f, 1.0f, raw.data(), tau.data(),
                                 alpha.data(), decay.data());
            simd::featuresForward(bricks, tile.kept.n, tile.kept.arrays(), tile.kept.ray.data(),
                                  tile.kept.weight.data(), features.data(), rays.data());
            for (int i = 0; i < tile.kept.n; ++i) {
                read_density += static_cast<double>(raw[i]) * tile.kept.dl_draw[i];
                magnitude += std::abs(raw[i] * tile.kept.dl_draw[i]);
            }
            read_features += dot({rays.data(), std::size_t(20 * channels)}, tile.dl_dray_features);
        }
        const Gathered sums = scatterAll(field, tiles);
        // Each voxel's sum is rounded a few times to 6e-8 of itself; the rest is in double.
        CHECK(dot(field.density(), sums.density) == Approx(read_density).margin(1e-6 * magnitude));
        CHECK(dot(field.features(), sums.features) ==
              Approx(read_features).margin(1e-6 * magnitude * channels));
        CHECK(magnitude > 100);  // or nothing was tested
    }
}

TEST_CASE(
    "touched voxels are the corners of the samples' cells, seen cells those that hold one; each leaf once") {
    const VoxelField field = test::randomField(kDims, 4, 0.05, -1.0f, 1.0f, 22);
    const Topology& topology = field.topology();
    const std::vector<TileGradients> tiles = randomTiles(field, 2, GENERATE(60, 1));
    std::vector<LeafMask> touched(topology.leafCount()), seen(topology.leafCount());
    for (const TileGradients& tile : tiles)
        for (int i = 0; i < tile.kept.n; ++i) {
            const int cell = tile.kept.cell[i];
            setBit(seen[tile.kept.leaf[i]], cell);
            for (int corner = 0; corner < 8; ++corner) {
                const Vec3i ijk = topology.leafCoords()[tile.kept.leaf[i]] * 8 +
                                  Vec3i((cell >> 6) + (corner >> 2), (cell >> 3 & 7) + (corner >> 1 & 1),
                                        (cell & 7) + (corner & 1));
                setBit(touched[topology.findLeaf(ijk / 8)], brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7));
            }
        }
    int n_touched_leaves = 0;
    for (const LeafMask& mask : touched) n_touched_leaves += mask != LeafMask{};
    const Gathered sums = scatterAll(field, tiles);
    CHECK(sums.touched == touched);
    CHECK(sums.seen == seen);
    CHECK(sums.calls == n_touched_leaves);
}

TEST_CASE("sums of gradients are the same bits on 1, 2 and 4 threads") {
    const VoxelField field = test::randomField(kDims, 8, 0.3, -1.0f, 1.0f, 23);
    const std::vector<TileGradients> tiles = randomTiles(field, 5, 700);
    const auto gathered = [&](int threads) {
        const ThreadLimit limit(threads);
        return scatterAll(field, tiles);
    };
    const Gathered one = gathered(1);
    for (const int threads : {2, 4}) {
        const Gathered many = gathered(threads);
        CHECK(std::memcmp(one.density.data(), many.density.data(), one.density.size() * 4) == 0);
        CHECK(std::memcmp(one.features.data(), many.features.data(), one.features.size() * 4) == 0);
        CHECK(one.seen == many.seen);
    }
}

TEST_CASE("nothing to scatter calls nobody") {
    const VoxelField field = test::randomField(kDims, 4, 0.3, -1.0f, 1.0f, 24);
    CHECK(scatterAll(field, {}).calls == 0);
    CHECK(scatterAll(field, randomTiles(field, 1, 0)).calls == 0);
}
