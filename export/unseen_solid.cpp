// SPDX-License-Identifier: Apache-2.0
#include "export/unseen_solid.h"

#include <atomic>
#include <cmath>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "export/marching_cubes.h"
#include "export/pixel_squares.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {
namespace {

struct Worker {
    RayTracer tracer{PixelSquares::kBlock * PixelSquares::kBlock};
    KeptSamples kept;
};

/// [leaf] the cells to which so much of some ray's light comes.
std::vector<LeafMask> litCells(const TraceScene& scene, std::size_t n_leaves, std::span<const Camera> cameras,
                               const UnseenOptions& options, Report& report) {
    TraceOptions trace;
    trace.min_weight = trace.max_dropped = 0;  // every sample is kept ...
    trace.stop_transmittance = options.least_light;  // ... up to where too little light is left

    const int edge = squareEdge(cameras, options.rays);
    std::vector<LeafMask> lit(n_leaves);
    PerThread<Worker> workers;
    report.begin("look for what is seen", static_cast<std::int64_t>(cameras.size()));
    for (std::size_t view = 0; view < cameras.size(); ++view) {
        if (report.cancelled()) throw Interrupted("mesh: stopped on request; nothing was written");
        const PixelSquares squares(cameras[view], view, edge);
        parallelFor(squares.blockCount(), [&](std::size_t block) {
            Worker& worker = workers.local();
            worker.tracer.clear();
            squares.forEachRay(block, [&](const Ray& ray) { worker.tracer.addRay(scene, ray, trace.step_voxels, 0.5f); });
            worker.tracer.trace(scene, trace, worker.kept);
            for (int k = 0; k < worker.kept.n; ++k)
                setBitShared(lit[static_cast<std::size_t>(worker.kept.leaf[k])], worker.kept.cell[k]);
        });
        report.update(static_cast<std::int64_t>(view) + 1, "");
    }
    report.end();
    return lit;
}

/// [leaf] the voxels at the corners of cells.
std::vector<LeafMask> cornersOf(const Bricks& bricks, const std::vector<LeafMask>& cells) {
    std::vector<LeafMask> corners(cells.size());
    parallelFor(cells.size(), [&](std::size_t leaf) {
        forEachBit(cells[leaf], [&](int cell) {
            for (int corner = 0; corner < 8; ++corner) {
                const std::size_t voxel = cornerIndex(bricks, static_cast<std::int32_t>(leaf), cell, corner);
                setBitShared(corners[voxel / kLeafVoxels], static_cast<int>(voxel % kLeafVoxels));
            }
        });
    });
    return corners;
}

}  // namespace

std::size_t makeUnseenSolid(Model& model, double iso, Report& report, const UnseenOptions& options) {
    const std::vector<Camera> cameras = camerasOf(model, /*held_out=*/false);
    const VoxelField& field = model.field;
    // A surface that is not there must not come of what is made solid: whoever looks for it says so.
    if (cameras.empty() || !(iso > 0) || iso > largestSigma(field)) return 0;
    const Topology& topology = field.topology();
    const Occupancy occupied = findOccupied(field, 0);
    const TraceScene scene(field, occupied);
    const std::vector<LeafMask> seen =
        cornersOf(scene.bricks, litCells(scene, topology.leafCount(), cameras, options, report));

    const float solid = static_cast<float>(std::log(2 * iso / field.densityScale()));  // raw, before the activation
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
