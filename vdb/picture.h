// SPDX-License-Identifier: Apache-2.0
// A picture of anything that rays can be traced through, by tiles of rays, in parallel. What a ray's colour is, the
// caller says: a field is decoded (renderer.h), a plain volume has its colour already (volume_renderer.h).
#pragma once

#include <functional>

#include "core/camera.h"
#include "core/image.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {

struct RenderedImage {
    Image rgb;      // 3 channels, sRGB values over the background
    Image opacity;  // 1 channel, 1 - transmittance
    Image depth;    // 1 channel, distance along the ray averaged by weight, world units; 0 where nothing counts
    Image normal;   // 3 channels in [-1, 1], world axes, averaged by weight, unit length; only if asked for
    TraceCounters counters;
};

/// Colours a traced tile: rgb [ray][3], zero at first -> sRGB values over the background. Called from any thread.
using ShadeTile = std::function<void(RayTracer& tracer, float* rgb)>;

/// Throws DataError for a camera that cannot be rendered (cameraProblem), UsageError for a step that is not positive.
RenderedImage renderPicture(const TraceScene& scene, const TraceOptions& options, bool normals, const Camera& camera,
                            const ShadeTile& shade);

}  // namespace nerfvdb
