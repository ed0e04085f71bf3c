// SPDX-License-Identifier: Apache-2.0
#include "vdb/picture.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kTile = 16;  // pixels along a tile's edge; neighbouring rays share leaves

/// What one thread needs to trace a tile.
struct Worker {
    RayTracer tracer{kTile * kTile};
    KeptSamples kept;
    std::vector<float> rgb = std::vector<float>(3 * kTile * kTile);
    std::vector<float> depth = std::vector<float>(kTile * kTile);
    std::vector<Vec3f> slope = std::vector<Vec3f>(kTile * kTile);
};

/// Slope of the interpolated density at a sample, per voxel: the derivative of the trilinear polynomial.
Vec3f densitySlope(const Bricks& bricks, const KeptSamples& kept, int i) {
    const float f[3] = {kept.x[i], kept.y[i], kept.z[i]};
    Vec3f slope = Vec3f::Zero();
    for (int corner = 0; corner < 8; ++corner) {
        const int bit[3] = {corner >> 2 & 1, corner >> 1 & 1, corner & 1};
        const float value = bricks.density[cornerIndex(bricks, kept.leaf[i], kept.cell[i], corner)];
        for (int axis = 0; axis < 3; ++axis) {
            const int b = (axis + 1) % 3, c = (axis + 2) % 3;
            const float weight = (bit[b] ? f[b] : 1 - f[b]) * (bit[c] ? f[c] : 1 - f[c]);
            slope[axis] += (bit[axis] ? weight : -weight) * value;
        }
    }
    return slope;
}

}  // namespace

RenderedImage renderPicture(const TraceScene& scene, const TraceOptions& options, bool normals, const Camera& camera,
                            const ShadeTile& shade) {
    const std::string problem = cameraProblem(camera);
    if (!problem.empty()) throw DataError("camera: " + problem);
    // Smaller steps would be more along a ray than a float can number (marchRays). A stretch through a layer is no longer
    // than the diagonal of its shell's box.
    const double least_step =
        std::ldexp(scene.shells.extent.cast<double>().norm(), scene.shells.mostHalvings() - 24);
    if (!(options.step_voxels >= least_step) || !(options.step_voxels > 0) || !std::isfinite(options.step_voxels))
        throw UsageError("rendering: step", std::to_string(options.step_voxels) + " voxels",
                         "a positive number, at least " + std::to_string(least_step));

    const int width = camera.width, height = camera.height;
    RenderedImage result;
    result.rgb = Image(width, height, 3);
    result.opacity = Image(width, height, 1);
    result.depth = Image(width, height, 1);
    if (normals) result.normal = Image(width, height, 3);

    const float voxel_size = static_cast<float>(scene.frame.voxel_size);
    const int tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
    PerThread<Worker> workers;
    parallelFor(static_cast<std::size_t>(tiles_x) * tiles_y, [&](std::size_t tile) {
        Worker& worker = workers.local();
        RayTracer& tracer = worker.tracer;
        const int x0 = static_cast<int>(tile) % tiles_x * kTile, y0 = static_cast<int>(tile) / tiles_x * kTile;
        const int x1 = std::min(x0 + kTile, width), y1 = std::min(y0 + kTile, height);
        tracer.clear();
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x)
                tracer.addRay(scene, cameraRay(camera, x + 0.5, y + 0.5), options.step_voxels, 0.5f);
        tracer.trace(scene, options, worker.kept);
        std::fill(worker.rgb.begin(), worker.rgb.end(), 0.0f);
        shade(tracer, worker.rgb.data());

        const KeptSamples& kept = worker.kept;
        // The mean over kept samples: what was dropped has opacity, but no place.
        std::fill(worker.depth.begin(), worker.depth.end(), 0.0f);
        for (int i = 0; i < kept.n; ++i)
            worker.depth[kept.ray[i]] += kept.weight[i] * (kept.t[i] + tracer.entry()[kept.ray[i]]);
        if (normals) {
            std::fill(worker.slope.begin(), worker.slope.end(), Vec3f::Zero());
            for (int i = 0; i < kept.n; ++i)
                worker.slope[kept.ray[i]] -= kept.weight[i] * densitySlope(scene.bricks, kept, i).normalized();
        }

        int r = 0;
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x, ++r) {
                std::copy_n(&worker.rgb[3 * r], 3, result.rgb.at(x, y));
                *result.opacity.at(x, y) = 1 - tracer.transmittance()[r];
                const float weight = tracer.weight()[r];
                *result.depth.at(x, y) = weight > 0 ? worker.depth[r] / weight * voxel_size : 0.0f;
                if (normals) {
                    const float length = worker.slope[r].norm();
                    for (int c = 0; c < 3; ++c)
                        result.normal.at(x, y)[c] = length > 0 ? worker.slope[r][c] / length : 0.0f;
                }
            }
    });
    for (const Worker& worker : workers) result.counters += worker.tracer.counters();
    return result;
}

}  // namespace nerfvdb
