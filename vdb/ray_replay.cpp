// SPDX-License-Identifier: Apache-2.0
#include "vdb/ray_replay.h"

namespace nerfvdb {

ReplayedRay replayRay(const Model& model, const Ray& ray, const TraceOptions& options, float jitter) {
    const VoxelField& field = model.field;
    const Occupancy occupancy = findOccupied(field, 0);
    const TraceScene scene(field, occupancy);
    TraceOptions all = options;
    all.min_weight = all.max_dropped = 0;
    all.skip_unlit = false;
    RayTracer tracer(1);
    tracer.addRay(scene, ray, all.step_voxels, jitter);
    KeptSamples kept;
    tracer.trace(scene, all, kept);

    const auto channels = static_cast<std::size_t>(field.channels());
    ReplayedRay replayed;
    for (int i = 0; i < kept.n; ++i) {
        ReplayedSample sample;
        sample.t = (static_cast<double>(kept.t[i]) + tracer.entry()[0]) * field.frame().voxel_size;
        const int cell = kept.cell[i];
        sample.cell = field.topology().leafCoords()[static_cast<std::size_t>(kept.leaf[i])] * kLeafDim +
                      Vec3i(cell >> 6, cell >> 3 & 7, cell & 7);
        sample.features.assign(channels, 0.0f);
        for (int corner = 0; corner < 8; ++corner) {
            const float weight = (corner & 4 ? kept.x[i] : 1 - kept.x[i]) *
                                 (corner & 2 ? kept.y[i] : 1 - kept.y[i]) *
                                 (corner & 1 ? kept.z[i] : 1 - kept.z[i]);
            const std::size_t value = cornerIndex(scene.bricks, kept.leaf[i], cell, corner);
            sample.raw += weight * scene.bricks.density[value];
            for (std::size_t c = 0; c < channels; ++c)
                sample.features[c] += weight * scene.bricks.features[value * channels + c];
        }
        const double scale = field.shells().layerScale(field.shells().layerAt(sample.cell.x()));
        sample.sigma = sigmaFromRaw(sample.raw, field.densityScale() / scale);
        sample.tau = kept.tau[i], sample.weight = kept.weight[i], sample.transmittance = kept.transmittance[i];
        replayed.samples.push_back(std::move(sample));
    }
    replayed.mean.assign(tracer.rayFeatures(), tracer.rayFeatures() + channels);
    replayed.transmittance = tracer.transmittance()[0];
    Decoder::Workspace work;
    model.decoder.forward(1, tracer.rayFeatures(), tracer.directions(), tracer.transmittance(),
                          replayed.rgb.data(), work);
    const Vec3f behind = model.sky.isEmpty() ? model.background : model.sky.at(tracer.directions());
    replayed.color = (1 - replayed.transmittance) * replayed.rgb + replayed.transmittance * behind;
    return replayed;
}

}  // namespace nerfvdb
