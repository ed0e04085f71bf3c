// SPDX-License-Identifier: Apache-2.0
#include "export/volume_colors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/image.h"
#include "core/parallel.h"
#include "export/diffuse_colors.h"
#include "export/paired_rays.h"
#include "export/pixel_squares.h"

namespace nerfvdb {
namespace {

constexpr int kChannels = Volume::kChannels;
constexpr int kBorderRounds = 2;  // a surface that a plain volume fattens is seen one voxel further out

/// Calls visit(first value of the neighbour's colour) for the 26 neighbours of a voxel that have a colour.
template <typename Visit>
void forEachColored(const Topology& topology, std::span<const LeafMask> colored, const Vec3i& voxel, const Visit& visit) {
    for (int n = 0; n < 27; ++n) {
        const Vec3i at = voxel + Vec3i(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
        if ((at.array() < 0).any()) continue;
        const int leaf = topology.findLeaf(at / kLeafDim);
        const int offset = brickOffset(at.x() & 7, at.y() & 7, at.z() & 7);
        if (leaf >= 0 && testBit(colored[leaf], offset))
            visit((static_cast<std::size_t>(leaf) * kLeafVoxels + offset) * kChannels);
    }
}

/// Voxels beside coloured ones get the mean of their colours, twice over. Returns which have a colour then.
std::vector<LeafMask> colorBorder(std::vector<LeafMask> colored, Volume& volume) {
    const Topology& topology = volume.topology();
    const std::span<float> color = volume.color();
    for (int round = 0; round < kBorderRounds; ++round) {
        std::vector<LeafMask> next = colored;
        parallelFor(topology.leafCount(), [&](std::size_t leaf) {
            LeafMask open = topology.voxels()[leaf];
            for (int word = 0; word < kLeafWords; ++word) open[word] &= ~colored[leaf][word];
            forEachBit(open, [&](int offset) {
                const Vec3i voxel =
                    topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
                Vec3f sum = Vec3f::Zero();
                int n = 0;
                forEachColored(topology, colored, voxel, [&](std::size_t first) {
                    sum += Eigen::Map<const Vec3f>(&color[first]);
                    ++n;
                });
                if (n == 0) return;
                setBit(next[leaf], offset);
                const Vec3f mean = sum / static_cast<float>(n);
                std::copy_n(mean.data(), 3, &color[(leaf * kLeafVoxels + offset) * kChannels]);
            });
        });
        colored = std::move(next);
    }
    return colored;
}

}  // namespace

void decodeColors(const Model& model, Volume& volume) {
    const Topology& topology = volume.topology();
    std::vector<LeafMask> colored(topology.leafCount());
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        std::vector<Vec3d> points;
        std::vector<int> offsets;
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i voxel =
                topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            points.push_back(volume.frame().worldFromIndex(voxel.cast<double>()));
            offsets.push_back(offset);
        });
        std::vector<float> rgb(points.size() * 3);
        const std::vector<bool> known = diffuseColors(model.decoder, model.field, points, rgb);
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (!known[i]) continue;
            setBit(colored[leaf], offsets[i]);
            for (int c = 0; c < 3; ++c)
                volume.color()[(leaf * kLeafVoxels + offsets[i]) * kChannels + c] = linearFromSrgb(rgb[3 * i + c]);
        }
    });
    colorBorder(std::move(colored), volume);
}

std::vector<LeafMask> collectColors(const Model& model, std::span<const Camera> cameras, const CollectOptions& options,
                                    Volume& volume, Report& report) {
    const int edge = squareEdge(cameras, options.rays);

    TraceOptions trace;
    trace.min_weight = options.min_weight;
    trace.max_dropped = options.max_dropped;
    const PairedRays pair(model, volume);
    PerThread<PairedTile> workers;
    LeafScatter scatter;
    std::vector<TileGradients> tiles;
    HugeArray<float> sums(volume.color().size());  // [leaf][512]: r, g, b (sRGB) and weight
    std::vector<LeafMask> seen(volume.topology().leafCount());

    report.begin("collect colours", static_cast<std::int64_t>(cameras.size()));
    for (std::size_t view = 0; view < cameras.size(); ++view) {
        throwIfCancelled(report);
        const PixelSquares squares(cameras[view], view, edge);
        const std::size_t n_tiles = squares.blockCount();
        tiles.resize(std::max(tiles.size(), n_tiles));
        parallelFor(n_tiles, [&](std::size_t block) {
            PairedTile& paired = workers.local();
            TileGradients& tile = tiles[block];
            std::vector<Ray>& rays = paired.rays;
            rays.clear();
            squares.forEachRay(block, [&](const Ray& ray) { rays.push_back(ray); });
            pair.trace(0.5f, trace, paired, tile.kept);
            std::fill_n(tile.kept.dl_draw.begin(), tile.kept.n, 0.0f);
            tile.dl_dray_features.assign(static_cast<std::size_t>(PairedTile::kMostRays) * kChannels, 0.0f);
            for (std::size_t r = 0; r < rays.size(); ++r) {
                if (!(paired.model.weight()[r] > 0)) continue;  // its colour is what the decoder makes of nothing
                float* const out = &tile.dl_dray_features[r * kChannels];
                std::copy_n(&paired.rgb[3 * r], 3, out);
                out[3] = 1;
            }
            tile.bin(volume.topology(), kChannels);
        });
        scatter.run(volume.topology(), kChannels, std::span(tiles.data(), n_tiles),
                    [&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask&) {
                        LeafMask touched;
                        std::copy_n(gradient.touched, kLeafWords, touched.begin());
                        forEachBit(touched, [&](int offset) {
                            const std::size_t voxel = static_cast<std::size_t>(leaf) * kLeafVoxels + offset;
                            float* const from = gradient.features + offset * kChannels;
                            for (int c = 0; c < kChannels; ++c) sums[voxel * kChannels + c] += std::exchange(from[c], 0.0f);
                            gradient.density[offset] = 0;
                        });
                        for (int word = 0; word < kLeafWords; ++word) {
                            seen[leaf][word] |= touched[word];
                            gradient.touched[word] = 0;
                        }
                    });
        report.update(static_cast<std::int64_t>(view) + 1, "");
    }
    report.end();

    std::vector<LeafMask> colored(seen.size());
    parallelFor(seen.size(), [&](std::size_t leaf) {
        forEachBit(seen[leaf], [&](int offset) {
            const std::size_t first = (leaf * kLeafVoxels + offset) * kChannels;
            const float weight = sums[first + 3];
            if (!(weight > 0)) return;  // seen through the volume, but not by the model
            setBit(colored[leaf], offset);
            for (int c = 0; c < 3; ++c) volume.color()[first + c] = linearFromSrgb(sums[first + c] / weight);
        });
    });
    colored = colorBorder(std::move(colored), volume);
    for (std::size_t leaf = 0; leaf < seen.size(); ++leaf)
        for (int word = 0; word < kLeafWords; ++word) seen[leaf][word] &= colored[leaf][word];
    return seen;
}

}  // namespace nerfvdb
