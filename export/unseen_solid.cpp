// SPDX-License-Identifier: Apache-2.0
#include "export/unseen_solid.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

constexpr int kTileRays = 256;
constexpr std::size_t kTilesPerBatch = 1024;  // between looks at whether to go on

struct Worker {
    RayTracer tracer{kTileRays};
    KeptSamples kept;
};

void setShared(LeafMask& mask, int offset) {
    std::atomic_ref word(mask[static_cast<std::size_t>(offset >> 6)]);
    const std::uint64_t bit = std::uint64_t{1} << (offset & 63);
    if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
}

/// Every stride-th pixel of a camera's pictures, from one that differs from camera to camera.
struct Rows {
    const Camera* camera;
    std::size_t first, count;  // rays: the first among all, how many
    std::size_t stride, phase;
};

/// [leaf] the cells that light comes to.
std::vector<LeafMask> litCells(const Model& model, const std::vector<Rows>& rows, float least_light, Report& report) {
    const Occupancy occupied = findOccupied(model.field, 0);
    const TraceScene scene(model.field, occupied);
    TraceOptions options;
    options.min_weight = options.max_dropped = 0;  // every sample is kept ...
    options.stop_transmittance = least_light;      // ... to which so much light comes

    std::vector<LeafMask> lit(model.field.topology().leafCount());
    const std::size_t n_rays = rows.back().first + rows.back().count, n_tiles = (n_rays + kTileRays - 1) / kTileRays;
    PerThread<Worker> workers;
    report.begin("look for what is seen", static_cast<std::int64_t>(n_tiles));
    for (std::size_t begin = 0; begin < n_tiles; begin += kTilesPerBatch) {
        if (report.cancelled()) throw Interrupted("mesh: stopped on request; nothing was written");
        const std::size_t end = std::min(begin + kTilesPerBatch, n_tiles);
        parallelFor(end - begin, [&](std::size_t t) {
            Worker& worker = workers.local();
            worker.tracer.clear();
            const std::size_t first = (begin + t) * kTileRays, last = std::min(first + kTileRays, n_rays);
            auto row = std::upper_bound(rows.begin(), rows.end(), first,
                                        [](std::size_t ray, const Rows& r) { return ray < r.first + r.count; });
            for (std::size_t ray = first; ray < last; ++ray) {
                if (ray >= row->first + row->count) ++row;
                const std::size_t pixel = (ray - row->first) * row->stride + row->phase;
                const auto width = static_cast<std::size_t>(row->camera->width);
                worker.tracer.addRay(scene,
                                     cameraRay(*row->camera, static_cast<double>(pixel % width) + 0.5,
                                               static_cast<double>(pixel / width) + 0.5),
                                     options.step_voxels, 0.5f);
            }
            worker.tracer.trace(scene, options, worker.kept);
            for (int k = 0; k < worker.kept.n; ++k)
                setShared(lit[static_cast<std::size_t>(worker.kept.leaf[k])], worker.kept.cell[k]);
        });
        report.update(static_cast<std::int64_t>(end), "");
    }
    report.end();
    return lit;
}

/// [leaf] the corners of cells.
std::vector<LeafMask> cornersOf(const VoxelField& field, const std::vector<LeafMask>& cells) {
    const Occupancy occupied = findOccupied(field, 0);
    const Bricks bricks = bricksOf(field, occupied);
    std::vector<LeafMask> corners(cells.size());
    parallelFor(cells.size(), [&](std::size_t leaf) {
        forEachBit(cells[leaf], [&](int cell) {
            for (int corner = 0; corner < 8; ++corner) {
                const auto voxel = static_cast<std::size_t>(cornerIndex(bricks, static_cast<std::int32_t>(leaf), cell, corner));
                setShared(corners[voxel / kLeafVoxels], static_cast<int>(voxel % kLeafVoxels));
            }
        });
    });
    return corners;
}

std::vector<Rows> raysOf(const Model& model, double most) {
    double pixels = 0;
    for (const ModelCamera& camera : model.cameras)
        if (!camera.held_out) pixels += static_cast<double>(camera.camera.width) * camera.camera.height;
    const auto stride = static_cast<std::size_t>(std::max(1.0, std::ceil(pixels / most)));
    std::vector<Rows> rows;
    std::size_t n = 0;
    for (const ModelCamera& camera : model.cameras) {
        if (camera.held_out) continue;
        const std::size_t own = static_cast<std::size_t>(camera.camera.width) * static_cast<std::size_t>(camera.camera.height);
        const std::size_t phase = mixBits(rows.size()) % stride;
        if (own <= phase) continue;
        const std::size_t count = (own - phase + stride - 1) / stride;
        rows.push_back({&camera.camera, n, count, stride, phase});
        n += count;
    }
    return rows;
}

}  // namespace

std::size_t makeUnseenSolid(Model& model, double iso, Report& report, const UnseenOptions& options) {
    const std::vector<Rows> rows = raysOf(model, options.rays);
    const Topology& topology = model.field.topology();
    if (rows.empty() || topology.leafCount() == 0) return 0;
    const std::vector<LeafMask> seen = cornersOf(model.field, litCells(model, rows, options.least_light, report));
    const float solid = static_cast<float>(std::log(2 * iso / model.field.densityScale()));  // raw, before the activation
    const std::span<float> density = model.field.density();
    std::atomic<std::size_t> raised = 0;
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        LeafMask unseen = topology.voxels()[leaf];
        for (int word = 0; word < kLeafWords; ++word) unseen[word] &= ~seen[leaf][word];
        std::size_t n = 0;
        forEachBit(unseen, [&](int offset) {
            float& raw = density[leaf * kLeafVoxels + static_cast<std::size_t>(offset)];
            if (raw >= solid) return;
            raw = solid;
            ++n;
        });
        raised += n;
    });
    return raised;
}

}  // namespace nerfvdb
