// SPDX-License-Identifier: Apache-2.0
// One ray, slowly: every sample that it reads and what becomes of its light, for whoever wonders why a pixel
// looks as it does.
#pragma once

#include <vector>

#include "core/camera.h"
#include "vdb/model.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {

struct ReplayedSample {
    double t = 0;                                  // world distance from the ray's origin
    Vec3i cell = Vec3i::Zero();                    // index space
    float raw = 0, sigma = 0;                      // density before and after its activation, per world unit
    float tau = 0, weight = 0, transmittance = 0;  // behind the sample
    std::vector<float> features;                   // [channels]
};

struct ReplayedRay {
    std::vector<ReplayedSample> samples;  // front to back, none dropped
    std::vector<float> mean;              // [channels] F
    float transmittance = 1;              // T_end
    Vec3f rgb = Vec3f::Zero();            // decoded
    Vec3f color = Vec3f::Zero();          // over the model's background
};

/// Traces one ray through a model as rendering does, but drops no weight; `jitter` as RayTracer::addRay has it.
ReplayedRay replayRay(const Model& model, const Ray& ray, const TraceOptions& options, float jitter);

}  // namespace nerfvdb
