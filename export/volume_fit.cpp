// SPDX-License-Identifier: Apache-2.0
#include "export/volume_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/image.h"
#include "core/parallel.h"
#include "core/random.h"
#include "vdb/volume_renderer.h"

namespace nerfvdb {
namespace {

constexpr int kTileRays = PairedTile::kMostRays;
constexpr int kChannels = Volume::kChannels;
constexpr float kThickest = 4.0f;     // optical depth over a voxel with which a fit begins ...
constexpr float kOpaque = 16.0f;      // ... and the most that it can reach: alpha = 1 - 1e-7
constexpr float kNothing = 1e-12f;    // sigma from which a voxel without density could grow
constexpr float kDarkestRoot = 0.01f;  // darker, a root has no slope left to leave by; linear 1e-4 shows as black

/// d displayValue / d light. Where light is clipped the slope stays, so that it can come back; near black, where
/// the curve is a straight line of slope 12.92, it is bounded by that.
float displaySlope(float light) {
    return std::min(12.92f, 1.055f / 2.4f * std::pow(std::clamp(light, 1e-4f, 1.0f), 1 / 2.4f - 1));
}

/// Other programs drop nothing; what is dropped here, the fit would make up for by brighter colours.
TraceOptions traceOptions() {
    TraceOptions options;
    options.min_weight = 2e-4f;
    options.max_dropped = 2e-3f;
    return options;
}

/// Independent streams of random bits of a step.
enum Stream : std::uint64_t { kPlaces, kBackgrounds, kJitter, kStreams };
std::uint64_t bitsOf(const FitOptions& options, Stream stream, int step, std::size_t i) {
    return randomBits(options.seed, static_cast<std::uint64_t>(step) * kStreams + stream, i);
}

}  // namespace

VolumeFit::VolumeFit(const Model& model, std::span<const Camera> cameras, const FitOptions& options, Volume& volume)
    : model_(model), cameras_(cameras), options_(options), volume_(volume), rays_(model, volume),
      log_sigma_(volume.sigma().size()), root_color_(volume.color().size()),
      density_moment_(volume.sigma().size()), color_moment_(volume.sigma().size()),
      tiles_((static_cast<std::size_t>(options.batch) + kTileRays - 1) / kTileRays) {
    const auto thickest = static_cast<float>(kThickest / volume.frame().voxel_size);
    parallelRanges(log_sigma_.size(), kLeafVoxels, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            volume_.sigma()[i] = std::min(volume_.sigma()[i], thickest);
            log_sigma_[i] = std::log(std::max(volume_.sigma()[i], kNothing));
        }
        for (std::size_t i = begin * kChannels; i < end * kChannels; ++i) root_color_[i] = std::sqrt(volume_.color()[i]);
    });
}

void VolumeFit::run(Report& report) {
    report.begin("fit volume", options_.steps);
    double mean_loss = 0;
    for (int step = 0; step < options_.steps; ++step) {
        throwIfCancelled(report);
        const double loss = differentiate(step);
        if (!std::isfinite(loss))
            throw NumericError("export: fit, step " + std::to_string(step), "a picture that is not finite",
                               "finite colours", "export with --fit 0");
        move(step);
        mean_loss = step == 0 ? loss : 0.98 * mean_loss + 0.02 * loss;
        char note[32];
        std::snprintf(note, sizeof note, "%.2f dB", -10 * std::log10(mean_loss / 3));
        report.update(step + 1, note);
    }
    report.end();
}

double VolumeFit::differentiate(int step) {
    std::vector<double> losses(tiles_.size());
    parallelFor(tiles_.size(), [&](std::size_t tile) { losses[tile] = differentiateTile(step, tile); });
    double sum = 0;
    for (const double loss : losses) sum += loss;
    return sum / static_cast<double>(tiles_.size() * kTileRays);
}

void VolumeFit::gradients(const LeafScatter::UseLeaf& use, const LeafScatter::ExpectLeaf& expect) {
    scatter_.run(volume_.topology(), kChannels, tiles_, use, /*min_seen=*/0, expect);
}

void VolumeFit::drawRays(int step, std::size_t tile, std::vector<Ray>& rays) const {
    rays.clear();
    for (int r = 0; r < kTileRays; ++r) {
        const std::uint64_t bits = bitsOf(options_, kPlaces, step, tile * kTileRays + r);
        const Camera& camera = cameras_[bits % cameras_.size()];
        const std::uint64_t place = mixBits(bits);
        rays.push_back(cameraRay(camera, camera.width * static_cast<double>(unitFloat(static_cast<std::uint32_t>(place))),
                                 camera.height * static_cast<double>(unitFloat(static_cast<std::uint32_t>(place >> 32)))));
    }
}

double VolumeFit::differentiateTile(int step, std::size_t tile) {
    PairedTile& paired = paired_.local();
    TileGradients& gradients = tiles_[tile];
    drawRays(step, tile, paired.rays);
    // Other programs put their samples where they like: so does each tile.
    const float jitter = unitFloat(static_cast<std::uint32_t>(bitsOf(options_, kJitter, step, tile)));
    rays_.trace(jitter, traceOptions(), paired, gradients.kept);

    double loss = 0;
    std::array<float, kTileRays> dl_dtransmittance{};
    gradients.dl_dray_features.assign(std::size_t{kTileRays} * kChannels, 0.0f);
    for (int r = 0; r < kTileRays; ++r) {
        const float opacity = 1 - paired.model.transmittance()[r];
        const float through = paired.volume.transmittance()[r], weight = paired.volume.weight()[r];
        const float* const color = paired.volume.rayFeatures() + r * kChannels;
        const std::uint64_t bits = bitsOf(options_, kBackgrounds, step, tile * kTileRays + r);
        for (int c = 0; c < 3; ++c) {
            const float behind = unitFloat(static_cast<std::uint32_t>(mixBits(bits + c)));
            const float light_behind = linearFromSrgb(behind);
            const float target = opacity * paired.rgb[3 * r + c] + (1 - opacity) * behind;
            const float light = weight * color[c] + through * light_behind;
            const float difference = displayValue(light) - target;
            loss += difference * difference;
            // weight = 1 - through, but for what was dropped
            const float dl_dlight = 2 * difference * displaySlope(light);
            gradients.dl_dray_features[r * kChannels + c] = dl_dlight * weight;
            dl_dtransmittance[r] += dl_dlight * (light_behind - color[c]);
        }
    }
    paired.volume.traceBackward(rays_.volumeScene(), gradients.dl_dray_features.data(), dl_dtransmittance.data(), 0,
                                gradients.kept);
    gradients.bin(volume_.topology(), kChannels);
    return loss;
}

void VolumeFit::move(int step) {
    const float left = std::pow(options_.last_rate, static_cast<float>(step) / static_cast<float>(options_.steps));
    const RmsPropRates rates{.density_rate = options_.density_rate * left, .feature_rate = options_.color_rate * left,
                             .decay = 0.95f, .epsilon = 1e-4f, .sparsity = 0, .density_smoothing = 0,
                             .feature_smoothing = 0};
    const auto largest = static_cast<float>(std::log(kOpaque / volume_.frame().voxel_size));
    gradients([&](std::int32_t leaf, const LeafGradient& gradient, const LeafMask&) {
        const std::size_t first = static_cast<std::size_t>(leaf) * kLeafVoxels;
        float* const sigma = &volume_.sigma()[first];
        float* const color = &volume_.color()[first * kChannels];
        float* const root = &root_color_[first * kChannels];
        LeafMask touched;
        std::copy_n(gradient.touched, kLeafWords, touched.begin());
        forEachBit(touched, [&](int offset) {
            gradient.density[offset] *= sigma[offset];  // d sigma / d ln sigma
            for (int c = offset * kChannels; c < offset * kChannels + 3; ++c) gradient.features[c] *= 2 * root[c];
        });
        simd::rmsPropLeaf(kChannels, rates, volume_.topology().voxels()[leaf].data(), gradient, &log_sigma_[first],
                          &density_moment_[first], root, &color_moment_[first]);
        const LeafMask& active = volume_.active()[leaf];
        forEachBit(touched, [&](int offset) {
            log_sigma_[first + offset] = std::min(log_sigma_[first + offset], largest);
            if (testBit(active, offset)) sigma[offset] = std::exp(log_sigma_[first + offset]);
            for (int c = offset * kChannels; c < offset * kChannels + 3; ++c) {
                root[c] = std::clamp(root[c], kDarkestRoot, 1.0f);
                color[c] = root[c] * root[c];
            }
        });
    }, [&](std::int32_t leaf, const LeafGradient& gradient) {
        const std::size_t first = static_cast<std::size_t>(leaf) * kLeafVoxels;
        simd::prefetchLeaf(kChannels, rates, volume_.topology().voxels()[leaf].data(), gradient, &log_sigma_[first],
                           &density_moment_[first], &root_color_[first * kChannels], &color_moment_[first]);
    });
}

}  // namespace nerfvdb
