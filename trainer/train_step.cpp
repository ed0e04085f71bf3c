// SPDX-License-Identifier: Apache-2.0
#include "trainer/train_step.h"

#include <algorithm>
#include <cmath>

#include "core/opacity_entropy.h"
#include "core/parallel.h"
#include "core/random.h"
#include "trainer/plain_background.h"

namespace nerfvdb {
namespace {

constexpr float kLeastSky = 1e-3f;  // rays to which less light comes from the sky say nothing about it
constexpr float kLargestGradient = 1e15f;  // of a ray: squares of sums over a batch stay finite in moments

bool isUsable(float gradient) { return std::abs(gradient) <= kLargestGradient; }

}  // namespace

StepReport TrainStepper::step(TrainState& state, const RaySource& source, std::uint64_t step, int batch,
                              const StepRates& rates, const TraceOptions& trace) {
    StepReport report = differentiate(state, source, step, batch, trace);
    if (!report.is_finite) return report;
    const std::span<const float> dl_dnetwork = networkGradient();
    if (!std::all_of(dl_dnetwork.begin(), dl_dnetwork.end(), isUsable)) {
        report.blame(source.draw(step, 0));
        return report;
    }

    const int channels = state.field.channels();
    const float smoothing = step % kSmoothEvery == 0 ? kSmoothEvery : 0;
    const RmsPropRates voxel_rates{rates.density, rates.features, rates.decay, rates.epsilon, rates.sparsity,
                                   smoothing * rates.density_smoothing, smoothing * rates.feature_smoothing};
    const auto expect = [&](std::int32_t leaf, const LeafGradient& gradient) {
        const std::size_t first = static_cast<std::size_t>(leaf) * kLeafVoxels;
        simd::prefetchLeaf(channels, voxel_rates, state.field.topology().voxels()[leaf].data(), gradient,
                           &state.field.density()[first], &state.density_moment[first],
                           &state.field.features()[first * channels], &state.feature_moment[first]);
    };
    const auto move = [&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask& seen) {
        const std::size_t first = static_cast<std::size_t>(leaf) * kLeafVoxels;
        simd::rmsPropLeaf(channels, voxel_rates, state.field.topology().voxels()[leaf].data(), gradient,
                          &state.field.density()[first], &state.density_moment[first],
                          &state.field.features()[first * channels], &state.feature_moment[first]);
        for (int word = 0; word < kLeafWords; ++word) state.seen[leaf][word] |= seen[word];
    };
    voxelGradients(state, move, expect);
    state.network.step(state.decoder.parameters(), dl_dnetwork, rates.network);
    if (!state.sky.isEmpty()) {
        state.sky_optimizer.step(state.sky.values(), skyGradient(state.sky), rates.sky);
        state.sky.smooth(rates.sky_smoothing, sky_scratch_);
    }
    if (state.exposures.learned())
        state.exposures.step(exposureGradient(state.exposures), report.rays, rates.exposure);
    return report;
}

StepReport TrainStepper::differentiate(const TrainState& state, const RaySource& source, std::uint64_t step,
                                       int batch, const TraceOptions& trace) {
    // Tiles small enough that a coarse batch still feeds eight cores, but no smaller: gradients of the network cost as
    // much for a few rays as for many. Their size follows from the batch alone.
    const int tile_rays = std::clamp(batch / 8, 64, kMaxTileRays);
    n_tiles_ = static_cast<std::size_t>((batch + tile_rays - 1) / tile_rays);
    if (tiles_.size() < n_tiles_) tiles_.resize(n_tiles_);
    if (gradients_.size() < n_tiles_) gradients_.resize(n_tiles_);

    const TraceScene scene(state.field, state.occupancy);
    parallelFor(n_tiles_, [&](std::size_t t) {
        const int first = static_cast<int>(t) * tile_rays;
        runTile(state, source, step, first, std::min(tile_rays, batch - first), scene, trace, tiles_[t],
                gradients_[t]);
    });

    StepReport report;
    for (std::size_t t = 0; t < n_tiles_; ++t) {
        const StepReport& tile = tiles_[t].report;
        report.squared_error += tile.squared_error;
        report.distortion += tile.distortion;
        report.entropy += tile.entropy;
        report.alpha_error += tile.alpha_error;
        report.plain_opacity += tile.plain_opacity;
        report.rays += tile.rays;
        report.trace += tile.trace;
        if (!tile.is_finite && report.is_finite) {
            report.is_finite = false;
            report.bad = tile.bad;
        }
    }
    return report;
}

void TrainStepper::voxelGradients(const TrainState& state, const LeafScatter::UseLeaf& use,
                                  const LeafScatter::ExpectLeaf& expect) {
    scatter_.run(state.field.topology(), state.field.channels(), std::span(gradients_.data(), n_tiles_), use,
                 state.min_seen, expect);
}

std::span<const float> TrainStepper::networkGradient() {
    dl_dnetwork_.resize(n_tiles_ > 0 ? tiles_.front().dl_dnetwork.size() : 0);
    parallelRanges(dl_dnetwork_.size(), 512, [&](std::size_t first, std::size_t last) {
        std::fill(dl_dnetwork_.begin() + first, dl_dnetwork_.begin() + last, 0.0f);
        for (std::size_t t = 0; t < n_tiles_; ++t)
            for (std::size_t i = first; i < last; ++i) dl_dnetwork_[i] += tiles_[t].dl_dnetwork[i];
    });
    return dl_dnetwork_;
}

std::span<const float> TrainStepper::skyGradient(const Sky& sky) {
    dl_dsky_.assign(sky.values().size(), 0.0f);
    for (std::size_t t = 0; t < n_tiles_; ++t)
        for (const SkyRay& ray : tiles_[t].sky_rays) Sky::backward(ray.sight, ray.dl_dcolor, dl_dsky_);
    return dl_dsky_;
}

std::span<const double> TrainStepper::exposureGradient(const Exposures& exposures) {
    dl_dexposures_.assign(exposures.viewCount() * Exposures::kValues, 0.0);
    for (std::size_t t = 0; t < n_tiles_; ++t) exposures.addGradient(tiles_[t].exposed, dl_dexposures_);
    return dl_dexposures_;
}

void TrainStepper::runTile(const TrainState& state, const RaySource& source, std::uint64_t step, int first_ray,
                           int n_rays, const TraceScene& scene, const TraceOptions& trace, Tile& tile,
                           TileGradients& gradients) {
    Worker& worker = workers_.local();
    RayTracer& tracer = worker.tracer;
    tracer.clear();
    tracer.resetCounters();
    source.boundMapped();
    const std::span<TrainingRay> rays(worker.rays.data(), static_cast<std::size_t>(n_rays));
    source.draw(step, static_cast<std::uint64_t>(first_ray), rays);
    for (const TrainingRay& drawn : rays) tracer.addRay(scene, drawn.ray, trace.step_voxels, drawn.jitter);
    tracer.trace(scene, trace, gradients.kept);
    const std::vector<std::int32_t>& lit = tracer.litRays();
    const int n_lit = static_cast<int>(lit.size());
    // Of other rays nothing must stay from the tile before: zero times NaN is NaN, and would name the wrong pixel.
    std::fill(worker.rgb.begin(), worker.rgb.end(), 0.0f);
    state.decoder.forward(n_lit, tracer.rayFeatures(), tracer.directions(), tracer.transmittance(), worker.rgb.data(),
                          worker.decoding, lit.data());

    tile.sky_rays.clear();
    tile.report = {};
    tile.report.rays = static_cast<std::uint64_t>(n_rays);
    tile.exposed.clear();
    const float exposed_background = state.exposures.withBackground() ? 1 : 0;
    for (int r = 0; r < n_rays; ++r) {
        const TrainingRay& drawn = worker.rays[r];
        const float transmittance = tracer.transmittance()[r], opacity = 1 - transmittance;
        const bool sees_sky = !state.sky.isEmpty() && transmittance > kLeastSky;
        const Sky::Sight sky = sees_sky ? state.sky.look(tracer.directions() + 3 * r) : Sky::Sight{};
        const Vec3f background = sees_sky ? sky.color : state.background;
        // Every other ray before the background itself, on which pictures are shown.
        const bool before_random = state.behind == Behind::random && mixBits(drawn.bits + 3) >> 63 != 0;
        float behind[3], light[3], color[3], dl_dcolor[3], dl_dlight[3];
        for (int c = 0; c < 3; ++c) {
            behind[c] = before_random ? unitFloat(static_cast<std::uint32_t>(mixBits(drawn.bits + c))) : background[c];
            light[c] = opacity * worker.rgb[3 * r + c] + exposed_background * transmittance * behind[c];
        }
        const Exposure exposure = state.exposures.of(drawn.view);
        const float coverage = opacity + exposed_background * transmittance;
        exposure.forward(light, coverage, color);
        float error = 0, off_background = 0;
        for (int c = 0; c < 3; ++c) {
            color[c] += (1 - exposed_background) * transmittance * behind[c];
            const float target = drawn.rgba[c] * drawn.rgba[3] + behind[c] * (1 - drawn.rgba[3]);
            const float difference = color[c] - target;
            off_background = std::max(off_background, std::abs(target - behind[c]));
            dl_dcolor[c] = 2 * difference;
            error += difference * difference;
        }
        float dl_dtransmittance = (exposed_background - 1) * exposure.backward(dl_dcolor, dl_dlight);
        Vec3f dl_dbackground;
        for (int c = 0; c < 3; ++c) {
            worker.dl_drgb[3 * r + c] = dl_dlight[c] * opacity;
            const float dl_dbehind = exposed_background * dl_dlight[c] + (1 - exposed_background) * dl_dcolor[c];
            dl_dtransmittance += dl_dbehind * behind[c] - dl_dlight[c] * worker.rgb[3 * r + c];
            dl_dbackground[c] = transmittance * dl_dbehind;
        }
        if (sees_sky) tile.sky_rays.push_back({sky, dl_dbackground});
        if (state.exposures.learned())
            tile.exposed.push_back({drawn.view, {light[0], light[1], light[2]}, coverage,
                                    {dl_dcolor[0], dl_dcolor[1], dl_dcolor[2]}});
        if (state.behind == Behind::plain && off_background <= kPlainTolerance) {
            dl_dtransmittance -= kPlainOpacity;
            tile.report.plain_opacity += opacity;
        }
        if (state.entropy > 0) {
            dl_dtransmittance += state.entropy * opacityEntropySlope(transmittance);
            tile.report.entropy += opacityEntropy(transmittance);
        }
        if (state.alpha > 0) {
            const float difference = opacity - drawn.rgba[3];
            dl_dtransmittance -= 2 * state.alpha * difference;
            tile.report.alpha_error += difference * difference;
        }
        worker.dl_dtransmittance[r] = dl_dtransmittance;
        tile.report.squared_error += error;
        if (!std::isfinite(error) && tile.report.is_finite) tile.report.blame(drawn);
    }

    tile.dl_dnetwork.assign(state.decoder.parameters().size(), 0.0f);
    gradients.dl_dray_features.resize(static_cast<std::size_t>(kMaxTileRays) * state.field.channels());
    state.decoder.backward(n_lit, worker.dl_drgb.data(), gradients.dl_dray_features.data(),
                           worker.dl_dtransmittance.data(), tile.dl_dnetwork, worker.decoding, lit.data());
    tracer.traceBackward(scene, gradients.dl_dray_features.data(), worker.dl_dtransmittance.data(),
                         state.distortion, gradients.kept);
    for (int i = 0; i < gradients.kept.n && tile.report.is_finite; ++i)
        if (!isUsable(gradients.kept.dl_draw[i])) tile.report.blame(worker.rays[gradients.kept.ray[i]]);
    tile.report.distortion = tracer.distortion();
    gradients.bin(state.field.topology(), state.field.channels());
    tile.report.trace = tracer.counters();
}

}  // namespace nerfvdb
