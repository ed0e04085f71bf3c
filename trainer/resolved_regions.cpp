// SPDX-License-Identifier: Apache-2.0
#include "trainer/resolved_regions.h"

#include <atomic>
#include <cmath>
#include <vector>

#include "trainer/looks.h"
#include "trainer/photo_sharpness.h"

namespace nerfvdb {
namespace {

constexpr std::uint64_t kRays = 250'000;
constexpr double kTooWide = 2;      // log2 of pixels, or of what is resolved of them: four
constexpr double kEnoughLight = 4;  // rays
constexpr double kUnit = 1024;      // sums are of integers, so that their order does not matter

/// What rays tell of a region; sums over its light.
struct Sums {
    std::atomic<std::int64_t> light = 0, width = 0;  // log2 of voxels' width, pixels
};

}  // namespace

std::shared_ptr<const Regions> resolvedRegions(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy,
                                               float min_seen, double shrink) {
    const Shells& shells = field.shells();
    if (shells.count == 1) return nullptr;
    const Regions* const known = shells.regions.get();
    // A region is a leaf when the first are halved; regions stay in place.
    const Vec3i dims = known ? known->dims : Vec3i(shells.extent / kLeafDim);
    std::vector<std::uint8_t> halvings =
        known ? known->halvings : std::vector<std::uint8_t>(static_cast<std::size_t>(shells.count * dims.prod()), 0);
    const Regions regions(dims, halvings);

    std::vector<std::size_t> region_of(field.topology().leafCount());
    std::vector<float> voxel_of(region_of.size());  // voxels of shell 0
    for (std::size_t leaf = 0; leaf < region_of.size(); ++leaf) {
        const Vec3i first = field.topology().leafCoords()[leaf] * kLeafDim;
        const int layer = shells.layerAt(first.x());
        voxel_of[leaf] = static_cast<float>(shells.layerScale(layer));
        const Vec3i region = shells.regionOf(layer, first, dims);
        if ((region.array() < dims.array()).all()) region_of[leaf] = regions.indexOf(shells.shellOf(layer), region);
    }

    const double finest = resolvedPixels(dataset);
    int stride = 1;
    while (raysOfLooks(dataset, stride) > kRays) ++stride;
    std::vector<Sums> sums(halvings.size());
    lookThrough(dataset, field, occupancy, min_seen, stride,
                [&](const View& view, const RayTracer& tracer, const KeptSamples& kept) {
                    for (int k = 0; k < kept.n; ++k) {
                        const auto leaf = static_cast<std::size_t>(kept.leaf[k]);
                        const double pixel = finest * (tracer.entry()[kept.ray[k]] + kept.t[k]) / view.camera.fx;
                        const double width = std::log2(std::max(voxel_of[leaf] / (shrink * pixel), 1e-6));
                        Sums& sum = sums[region_of[leaf]];
                        sum.light.fetch_add(std::llround(kUnit * kept.weight[k]), std::memory_order_relaxed);
                        sum.width.fetch_add(std::llround(kUnit * kept.weight[k] * width), std::memory_order_relaxed);
                    }
                });
    bool is_any = false;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        const auto light = static_cast<double>(sums[i].light.load()), width = static_cast<double>(sums[i].width.load());
        if (halvings[i] >= kMostHalvings || light < kEnoughLight * kUnit || width < kTooWide * light) continue;
        ++halvings[i];
        is_any = true;
    }
    return is_any ? makeRegions(shells.count, dims, std::move(halvings)) : nullptr;
}

}  // namespace nerfvdb
