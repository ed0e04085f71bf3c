// SPDX-License-Identifier: Apache-2.0
#include "vdb/renderer.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

struct Worker {
    Decoder::Workspace decoding;
    std::vector<float> features, rgb;  // of lit rays, side by side; only without view-dependence
};

/// Colours of the lit rays, averaged over directions.
void decodeDiffuse(const Decoder& decoder, RayTracer& tracer, float* rgb, Worker& worker) {
    const std::vector<std::int32_t>& lit = tracer.litRays();
    const auto channels = static_cast<std::size_t>(decoder.channels());
    worker.features.resize(lit.size() * channels);
    worker.rgb.resize(lit.size() * 3);
    for (std::size_t i = 0; i < lit.size(); ++i)
        std::copy_n(tracer.rayFeatures() + static_cast<std::size_t>(lit[i]) * channels, channels,
                    &worker.features[i * channels]);
    decoder.diffuse(static_cast<int>(lit.size()), worker.features.data(), worker.rgb.data());
    for (std::size_t i = 0; i < lit.size(); ++i) std::copy_n(&worker.rgb[3 * i], 3, rgb + 3 * lit[i]);
}

}  // namespace

Renderer::Renderer(const Model& model, const RenderOptions& options)
    : Renderer(model, options, findOccupied(model.field, options.min_alpha)) {}

Renderer::Renderer(const Model& model, const RenderOptions& options, Occupancy occupancy)
    : model_(model), options_(options), occupancy_(std::move(occupancy)) {}

RenderedImage Renderer::render(const Camera& camera) const {
    PerThread<Worker> workers;
    const auto shade = [&](RayTracer& tracer, float* rgb) {
        Worker& worker = workers.local();
        const std::vector<std::int32_t>& lit = tracer.litRays();
        if (options_.view_dependent)
            model_.decoder.forward(static_cast<int>(lit.size()), tracer.rayFeatures(), tracer.directions(),
                                   tracer.transmittance(), rgb, worker.decoding, lit.data());
        else
            decodeDiffuse(model_.decoder, tracer, rgb, worker);
        for (int r = 0; r < tracer.rayCount(); ++r) {
            const float transmittance = tracer.transmittance()[r], opacity = 1 - transmittance;
            const bool sees_sky = !model_.sky.isEmpty() && transmittance > 0;
            const Vec3f behind = sees_sky ? model_.sky.at(tracer.directions() + 3 * r) : model_.background;
            for (int c = 0; c < 3; ++c) rgb[3 * r + c] = opacity * rgb[3 * r + c] + transmittance * behind[c];
        }
    };
    return renderPicture(TraceScene(model_.field, occupancy_), options_.trace, options_.normals, camera, shade);
}

}  // namespace nerfvdb
