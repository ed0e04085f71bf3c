// SPDX-License-Identifier: Apache-2.0
#include "bench/voxel_scene.h"

namespace nerfvdb {

TraceOptions nothingSkipped() {
    TraceOptions options;
    options.step_voxels = 0.5f;
    options.stop_transmittance = 0, options.min_weight = 0, options.max_dropped = 0;
    return options;
}

RaySight look(const TraceScene& scene, const Ray& ray, const TraceOptions& options) {
    RayTracer tracer(1);
    RaySight seen;
    tracer.addRay(scene, ray, options.step_voxels, 0.5f);
    tracer.trace(scene, options, seen.kept);
    for (int c = 0; c < 3; ++c) seen.mean[c] = tracer.rayFeatures()[c];
    seen.opacity = 1 - static_cast<double>(tracer.transmittance()[0]);
    seen.counters = tracer.counters();
    return seen;
}

}  // namespace nerfvdb
