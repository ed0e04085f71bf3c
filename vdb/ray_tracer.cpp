// SPDX-License-Identifier: Apache-2.0
#include "vdb/ray_tracer.h"

#include <algorithm>
#include <cmath>

namespace nerfvdb {
namespace {

constexpr int kSamplesPerRound = 8;  // a ray that turns opaque has looked at most this far behind its last sample
constexpr double kMostTauScale = 1e30;  // times exp(kMaxRaw) it is finite still
// Rays whose kept weights sum to less show nothing; the inverse of the sum, times a gradient, might overflow.
constexpr float kLeastWeight = 1e-30f;

}  // namespace

TraceScene::TraceScene(const VoxelField& field, const Occupancy& occupancy)
    : bricks(bricksOf(field, occupancy)), frame(field.frame()),
      box_max((field.topology().dims() - Vec3i::Ones()).cast<double>()), density_scale(field.densityScale()),
      holds_sigma(false) {}

TraceScene::TraceScene(const Volume& volume, const Occupancy& occupancy)
    : bricks(bricksOf(volume.topology(), occupancy)), frame(volume.frame()),
      box_max((volume.topology().dims() - Vec3i::Ones()).cast<double>()), density_scale(1), holds_sigma(true) {
    bricks.density = volume.sigma().data();
    bricks.features = volume.color().data();
    bricks.channels = Volume::kChannels;
}

TraceCounters& TraceCounters::operator+=(const TraceCounters& other) {
    rays += other.rays;
    rays_skipped += other.rays_skipped;
    samples_dense += other.samples_dense;
    samples_density += other.samples_density;
    samples_features += other.samples_features;
    return *this;
}

void KeptSamples::reserve(std::size_t size) {
    size += kPadding;
    if (leaf.size() >= size) return;
    size += size / 2;
    for (auto* array : {&leaf, &cell, &ray}) array->resize(size);
    for (auto* array : {&x, &y, &z, &t, &weight, &tau, &transmittance, &dl_draw}) array->resize(size);
}

RayTracer::RayTracer(int max_rays) {
    const std::size_t rays = static_cast<std::size_t>(max_rays + kPadding);
    for (auto* array : {&ox_, &oy_, &oz_, &dx_, &dy_, &dz_, &length_, &offset_, &entry_, &transmittance_, &dropped_})
        array->resize(rays);
    light_.resize(rays);
    directions_.resize(3 * rays);
    for (auto* array : {&next_, &alive_, &begin_}) array->resize(rays + 1);
    const std::size_t samples = rays * (kSamplesPerRound + kPadding) + kPadding;
    for (auto* array : {&leaf_, &cell_}) array->resize(samples);
    for (auto* array : {&x_, &y_, &z_, &t_, &raw_, &tau_, &alpha_, &decay_}) array->resize(samples);
}

void RayTracer::addRay(const TraceScene& scene, const Ray& ray, float step_voxels, float jitter) {
    const Vec3d origin = scene.frame.indexFromWorld(ray.origin);
    double t_enter = 0, t_leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        // A ray parallel to a face divides by zero: the infinities order themselves. One that runs in a face is
        // 0 / 0 there: on the lower face NaN loses every comparison and the other axes decide; on the upper face,
        // behind which no cell lies, the ray misses.
        const double inverse = 1.0 / ray.direction[axis];
        const double a = (0.0 - origin[axis]) * inverse, b = (scene.box_max[axis] - origin[axis]) * inverse;
        t_enter = std::max(t_enter, std::min(a, b));
        t_leave = std::min(t_leave, std::max(a, b));
    }
    const int r = n_rays_++;
    const bool hits = t_leave > t_enter && std::isfinite(t_leave);
    const Vec3d entry = origin + ray.direction * (hits ? t_enter : 0.0);
    ox_[r] = static_cast<float>(entry.x()), dx_[r] = static_cast<float>(ray.direction.x());
    oy_[r] = static_cast<float>(entry.y()), dy_[r] = static_cast<float>(ray.direction.y());
    oz_[r] = static_cast<float>(entry.z()), dz_[r] = static_cast<float>(ray.direction.z());
    length_[r] = hits ? static_cast<float>(t_leave - t_enter) : 0.0f;
    entry_[r] = hits ? static_cast<float>(t_enter) : 0.0f;
    offset_[r] = jitter * step_voxels;
    for (int axis = 0; axis < 3; ++axis) directions_[3 * r + axis] = static_cast<float>(ray.direction[axis]);
    counters_.samples_dense += static_cast<std::uint64_t>(length_[r] / step_voxels);
}

void RayTracer::trace(const TraceScene& scene, const TraceOptions& options, KeptSamples& kept) {
    const int channels = scene.bricks.channels;
    tau_scale_ = static_cast<float>(std::min(
        scene.density_scale * scene.frame.voxel_size * static_cast<double>(options.step_voxels), kMostTauScale));
    const RayTile rays{n_rays_, ox_.data(), oy_.data(), oz_.data(), dx_.data(), dy_.data(), dz_.data(),
                       length_.data(), offset_.data(), next_.data()};
    const SampleArrays samples{leaf_.data(), cell_.data(), x_.data(), y_.data(), z_.data(), t_.data()};

    kept.n = 0;
    int n_alive = 0;
    for (int r = 0; r < n_rays_; ++r) {
        light_[r] = 1;
        dropped_[r] = 0;
        next_[r] = 0;
        alive_[n_alive++] = r;
    }
    counters_.rays += static_cast<std::uint64_t>(n_rays_);
    for (bool first_round = true; n_alive > 0; first_round = false) {
        const int n = simd::marchRays(scene.bricks, rays, options.step_voxels, kSamplesPerRound, alive_.data(),
                                      n_alive, begin_.data(), samples);
        if (scene.holds_sigma)
            simd::sigmaForward(scene.bricks, n, samples, tau_scale_, tau_.data(), alpha_.data(), decay_.data());
        else
            simd::densityForward(scene.bricks, n, samples, kMaxRaw, tau_scale_, raw_.data(), tau_.data(),
                                 alpha_.data(), decay_.data());
        counters_.samples_density += static_cast<std::uint64_t>(n);
        kept.reserve(static_cast<std::size_t>(kept.n) + static_cast<std::size_t>(n));

        int n_left = 0, k = kept.n;
        for (int a = 0; a < n_alive; ++a) {
            const int r = alive_[a];
            CompositeRay light{light_[r]};
            float dropped = dropped_[r];
            for (int i = begin_[a]; i < begin_[a + 1] && light.transmittance >= options.stop_transmittance; ++i) {
                const float weight = light.add(alpha_[i], decay_[i]);
                if (weight < options.min_weight && dropped + weight <= options.max_dropped) {
                    dropped += weight;
                    continue;
                }
                kept.leaf[k] = leaf_[i], kept.cell[k] = cell_[i], kept.ray[k] = r;
                kept.x[k] = x_[i], kept.y[k] = y_[i], kept.z[k] = z_[i], kept.t[k] = t_[i];
                kept.weight[k] = weight, kept.tau[k] = tau_[i], kept.transmittance[k] = static_cast<float>(light.transmittance);
                ++k;
            }
            light_[r] = light.transmittance, dropped_[r] = dropped;
            counters_.rays_skipped += first_round && begin_[a] == begin_[a + 1];
            if (next_[r] >= 0 && light.transmittance >= options.stop_transmittance) alive_[n_left++] = r;
        }
        kept.n = k;
        n_alive = n_left;
    }

    for (int r = 0; r < n_rays_; ++r) transmittance_[r] = static_cast<float>(light_[r]);

    // Marked in begin_, which the rounds are done with.
    std::fill_n(begin_.begin(), n_rays_, 0);
    for (int i = 0; i < kept.n; ++i) begin_[kept.ray[i]] = 1;
    lit_.clear();
    for (int r = 0; r < n_rays_; ++r)
        if (begin_[r] || transmittance_[r] < 1 || !options.skip_unlit) lit_.push_back(r);
    counters_.samples_features += static_cast<std::uint64_t>(kept.n);

    const std::size_t n_features = static_cast<std::size_t>(kept.n + kPadding) * channels;
    if (features_.size() < n_features) features_.resize(n_features + n_features / 2);
    ray_features_.resize(transmittance_.size() * channels);
    std::fill_n(ray_features_.begin(), static_cast<std::size_t>(n_rays_) * channels, 0.0f);
    kept.reserve(static_cast<std::size_t>(kept.n));
    simd::featuresForward(scene.bricks, kept.n, kept.arrays(), kept.ray.data(), kept.weight.data(), features_.data(),
                          ray_features_.data());
    averageFeatures(channels, kept);
}

void RayTracer::averageFeatures(int channels, const KeptSamples& kept) {
    // The sum over the kept samples, not 1 - T: what was dropped has opacity, but no features.
    weight_.assign(static_cast<std::size_t>(n_rays_), 0.0f);
    inverse_weight_.resize(static_cast<std::size_t>(n_rays_));
    for (int i = 0; i < kept.n; ++i) weight_[kept.ray[i]] += kept.weight[i];
    for (int r = 0; r < n_rays_; ++r) {
        inverse_weight_[r] = weight_[r] >= kLeastWeight ? 1 / weight_[r] : 0.0f;
        float* const features = &ray_features_[static_cast<std::size_t>(r) * channels];
        for (int c = 0; c < channels; ++c) features[c] *= inverse_weight_[r];
    }
}

void RayTracer::addFeatureSlopes(int channels, float* dl_dray_features, const KeptSamples& kept) {
    mean_slope_.assign(static_cast<std::size_t>(n_rays_), 0.0f);
    for (int r = 0; r < n_rays_; ++r)
        for (std::size_t i = static_cast<std::size_t>(r) * channels; i < static_cast<std::size_t>(r + 1) * channels; ++i) {
            dl_dray_features[i] *= inverse_weight_[r];
            mean_slope_[r] += dl_dray_features[i] * ray_features_[i];
        }
    simd::rowDots(kept.n, channels, features_.data(), kept.ray.data(), dl_dray_features, slope_.data());
    for (int i = 0; i < kept.n; ++i) slope_[i] -= mean_slope_[kept.ray[i]];
}

void RayTracer::addDistortionSlopes(float per_voxel, float dl_ddistortion, const KeptSamples& kept) {
    spread_.assign(static_cast<std::size_t>(n_rays_), {});
    for (int i = 0; i < kept.n; ++i) spread_[kept.ray[i]].add(kept.weight[i], kept.t[i] * per_voxel);
    distortion_ = 0;
    spread_backward_.clear();
    for (const DistortionRay& ray : spread_) {
        distortion_ += static_cast<double>(ray.spread);
        spread_backward_.emplace_back(ray);
    }
    for (int i = kept.n; i-- > 0;)
        slope_[i] += dl_ddistortion * spread_backward_[kept.ray[i]].add(kept.weight[i], kept.t[i] * per_voxel);
}

void RayTracer::traceBackward(const TraceScene& scene, float* dl_dray_features, const float* dl_dtransmittance,
                              float dl_ddistortion, KeptSamples& kept) {
    if (slope_.size() < static_cast<std::size_t>(kept.n + kPadding))
        slope_.resize(static_cast<std::size_t>(kept.n + kPadding) * 3 / 2);
    addFeatureSlopes(scene.bricks.channels, dl_dray_features, kept);
    addDistortionSlopes(1 / static_cast<float>(scene.box_max.maxCoeff()), dl_ddistortion, kept);
    behind_.clear();
    for (int r = 0; r < n_rays_; ++r) behind_.emplace_back(transmittance_[r], dl_dtransmittance[r]);
    for (int i = kept.n; i-- > 0;) {
        const float dl_dtau = behind_[kept.ray[i]].add(kept.weight[i], kept.transmittance[i], slope_[i]);
        kept.dl_draw[i] = (scene.holds_sigma ? tau_scale_ : kept.tau[i]) * dl_dtau;  // d tau / d raw = tau
    }
}

}  // namespace nerfvdb
