// SPDX-License-Identifier: Apache-2.0
#include "trainer/looks.h"

#include <algorithm>
#include <vector>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kTile = 16;  // rays along a tile's edge

struct Worker {
    RayTracer tracer{kTile * kTile};
    KeptSamples kept;
};

/// A block of the rays of one view, which lie `stride` pixels apart.
struct Tile {
    std::size_t view;
    int x, y;  // of its first ray, in rays
};

int raysAlong(int pixels, int stride) { return (pixels + stride - 1) / stride; }

}  // namespace

std::uint64_t raysOfLooks(const Dataset& dataset, int stride) {
    std::uint64_t rays = 0;
    for (const View& view : dataset.views)
        rays += static_cast<std::uint64_t>(raysAlong(view.camera.width, stride)) *
                static_cast<std::uint64_t>(raysAlong(view.camera.height, stride));
    return rays;
}

void lookThrough(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy, float min_weight, int stride,
                 const UseLook& use) {
    std::vector<Tile> tiles;
    for (std::size_t v = 0; v < dataset.views.size(); ++v)
        for (int y = 0; y < raysAlong(dataset.views[v].camera.height, stride); y += kTile)
            for (int x = 0; x < raysAlong(dataset.views[v].camera.width, stride); x += kTile) tiles.push_back({v, x, y});

    const TraceScene scene(field, occupancy);
    TraceOptions options;  // only what counts is kept, and of that features are read for nothing
    options.min_weight = min_weight;
    options.max_dropped = 1;
    PerThread<Worker> workers;
    parallelFor(tiles.size(), [&](std::size_t t) {
        Worker& worker = workers.local();
        const Tile& tile = tiles[t];
        const View& view = dataset.views[tile.view];
        const int width = raysAlong(view.camera.width, stride), height = raysAlong(view.camera.height, stride);
        worker.tracer.clear();
        for (int j = tile.y; j < std::min(tile.y + kTile, height); ++j)
            for (int i = tile.x; i < std::min(tile.x + kTile, width); ++i) {
                const int x = i * stride, y = j * stride;
                if (!view.mask.empty() && !view.mask.counts(x, y)) continue;
                worker.tracer.addRay(scene, cameraRay(view.camera, x + 0.5, y + 0.5), options.step_voxels, 0.5f);
            }
        if (worker.tracer.rayCount() == 0) return;
        worker.tracer.trace(scene, options, worker.kept);
        use(view, worker.tracer, worker.kept);
    });
}

}  // namespace nerfvdb
