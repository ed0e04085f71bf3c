// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_renderer.h"

#include <algorithm>

namespace nerfvdb {

float displayValue(float linear) { return srgbFromLinear(std::clamp(linear, 0.0f, 1.0f)); }

VolumeRenderer::VolumeRenderer(const Volume& volume, const VolumeRenderOptions& options)
    : volume_(volume), options_(options), occupancy_(allCells(volume)) {}

RenderedImage VolumeRenderer::render(const Camera& camera) const {
    TraceOptions trace;
    trace.step_voxels = options_.step_voxels;
    trace.stop_transmittance = options_.stop_transmittance;
    trace.min_weight = 0;  // others drop nothing either
    Vec3f behind;
    for (int c = 0; c < 3; ++c) behind[c] = linearFromSrgb(options_.background[c]);
    const auto shade = [&](RayTracer& tracer, float* rgb) {
        for (int r = 0; r < tracer.rayCount(); ++r)
            for (int c = 0; c < 3; ++c)
                rgb[3 * r + c] = displayValue(tracer.weight()[r] * tracer.rayFeatures()[r * Volume::kChannels + c] +
                                              tracer.transmittance()[r] * behind[c]);
    };
    const Camera in_grid = volume_.worldFromGrid().inverse().apply(camera);
    RenderedImage picture =
        renderPicture(TraceScene(volume_, occupancy_), trace, options_.normals, in_grid, shade);
    const Eigen::Matrix3f turn = volume_.worldFromGrid().rotation.cast<float>();
    for (std::size_t i = 0; i < picture.normal.pixels.size(); i += 3)
        Eigen::Map<Vec3f>(&picture.normal.pixels[i]) = turn * Vec3f(&picture.normal.pixels[i]);
    return picture;
}

}  // namespace nerfvdb
