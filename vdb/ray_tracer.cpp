// SPDX-License-Identifier: Apache-2.0
#include "vdb/ray_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace nerfvdb {
namespace {

constexpr int kStepsPerRound = 32;  // through a leaf at once: at steps of half a voxel, its diagonal is 28
constexpr double kMostTauScale = 1e30;  // times exp(kMaxRaw) it is finite still
// Rays whose kept weights sum to less show nothing; the inverse of the sum, times a gradient, might overflow.
constexpr float kLeastWeight = 1e-30f;

}  // namespace

TraceScene::TraceScene(const VoxelField& field, const Occupancy& occupancy)
    : bricks(bricksOf(field, occupancy)), frame(field.frame()), shells(field.shells()),
      density_scale(field.densityScale()), holds_sigma(false) {}

TraceScene::TraceScene(const Volume& volume, const Occupancy& occupancy)
    : bricks(bricksOf(volume.topology(), occupancy)), frame(volume.frame()),
      shells{1, volume.topology().dims() - Vec3i::Ones(), 0}, density_scale(1), holds_sigma(true) {
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
    for (auto* array : {&entry_, &transmittance_, &dropped_}) array->resize(rays);
    light_.resize(rays);
    directions_.resize(3 * rays);
    has_met_.resize(rays);
    for (auto* array : {&alive_, &begin_, &first_stretch_}) array->resize(rays + 1);
    const std::size_t samples = rays * kStepsPerRound + kPadding;
    for (auto* array : {&leaf_, &cell_}) array->resize(samples);
    for (auto* array : {&x_, &y_, &z_, &t_, &raw_, &tau_, &alpha_, &decay_}) array->resize(samples);
}

namespace {

/// Where a line is inside a box, as distances along it.
struct Interval {
    double begin = 0, end = std::numeric_limits<double>::infinity();
    bool isEmpty() const { return !(end > begin && std::isfinite(end)); }
};

Interval insideBox(const Vec3d& low, const Vec3d& high, const Vec3d& origin, const Vec3d& direction) {
    Interval inside;
    for (int axis = 0; axis < 3; ++axis) {
        // A ray parallel to a face divides by zero: the infinities order themselves. One that runs in a face is
        // 0 / 0 there: on the lower face NaN loses every comparison and the other axes decide; on the upper face,
        // behind which no cell lies, the ray misses.
        const double inverse = 1.0 / direction[axis];
        const double a = (low[axis] - origin[axis]) * inverse, b = (high[axis] - origin[axis]) * inverse;
        inside.begin = std::max(inside.begin, std::min(a, b));
        inside.end = std::min(inside.end, std::max(a, b));
    }
    return inside;
}

/// To millionths of a voxel, so that coordinates of all layers, which differ by powers of two and whole voxels, are exact (but in
/// the largest fields of 14 shells and more): a ray in a face between layers, or as good as in it, lies on the same side for
/// all of them.
Vec3d onFineGrid(const Vec3d& index) {
    constexpr double kPerVoxel = 1 << 20;
    return (index * kPerVoxel).array().round() / kPerVoxel;
}

/// Without components that are roundings of zero: they would say that a ray leaves the face in which it lies.
Vec3d withoutTraces(const Vec3d& direction) {
    constexpr double kTrace = 1e-12;
    return direction.unaryExpr([](double d) { return std::abs(d) < kTrace ? 0.0 : d; });
}

/// In single precision, and in the same cell still.
float inSameCell(double x) {
    const auto nearest = static_cast<float>(x);
    return std::floor(nearest) > x ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
}

}  // namespace

void RayTracer::addRay(const TraceScene& scene, const Ray& ray, float step_voxels, float jitter) {
    const Vec3d index = scene.frame.indexFromWorld(ray.origin);
    const bool is_layered = scene.shells.count > 1;
    const Vec3d origin = is_layered ? onFineGrid(index) : index;
    const Vec3d direction = is_layered ? withoutTraces(ray.direction) : ray.direction;
    const int r = n_rays_++;
    if (r == 0) n_stretches_ = 0;
    for (int axis = 0; axis < 3; ++axis) directions_[3 * r + axis] = static_cast<float>(ray.direction[axis]);
    entry_[r] = 0;
    first_stretch_[r] = n_stretches_;

    // The boxes lie inside each other: a ray enters them from the outside in and leaves them from the inside out.
    const Vec3d extent = scene.shells.extent.cast<double>(), center = 0.5 * extent;
    std::array<Interval, kMaxShells> inside;
    int innermost = scene.shells.count;
    for (int shell = scene.shells.count - 1; shell >= 0; --shell) {
        const Vec3d half = Shells::scale(shell) * center;
        inside[shell] = insideBox(center - half, center + half, origin, direction);
        if (inside[shell].isEmpty()) break;
        innermost = shell;
    }
    const int outermost = scene.shells.count - 1;
    if (innermost <= outermost) {
        const double t_entry = inside[outermost].begin;
        entry_[r] = static_cast<float>(t_entry);
        const Way way{origin, direction, t_entry, jitter * step_voxels};
        const auto add = [&](int shell, double t_begin, double t_end) {
            if (t_end > t_begin) addStretches(scene, shell, way, t_begin, t_end);
        };
        for (int shell = outermost; shell > innermost; --shell) add(shell, inside[shell].begin, inside[shell - 1].begin);
        add(innermost, inside[innermost].begin, inside[innermost].end);
        for (int shell = innermost + 1; shell <= outermost; ++shell) add(shell, inside[shell - 1].end, inside[shell].end);
    }
    first_stretch_[r + 1] = n_stretches_;
    for (int s = first_stretch_[r]; s < n_stretches_; ++s)
        counters_.samples_dense += static_cast<std::uint64_t>(length_[s] / step_voxels);
}

void RayTracer::addStretches(const TraceScene& scene, int shell, const Way& way, double t_begin, double t_end) {
    const Shells& shells = scene.shells;
    const Regions* const regions = shells.regions.get();
    if (!regions || (regions->halved[shell].end.array() == 0).any())
        return addStretch(scene, shells.layerOf(shell, 0), way, t_begin, t_end);
    const Regions::Range& range = regions->halved[shell];
    const Vec3d width = shells.extent.cast<double>().cwiseQuotient(regions->dims.cast<double>());  // of a region, cells
    const Vec3d origin = (shells.fromInner(shell, way.origin) - shells.corner(shell).cast<double>()).cwiseQuotient(width);
    const Vec3d direction = way.direction.cwiseQuotient(width) / Shells::scale(shell);  // regions a voxel of shell 0
    const Interval halved = insideBox(range.first.cast<double>(), range.end.cast<double>(), origin, direction);
    const double t_first = std::max(t_begin, halved.begin), t_last = std::min(t_end, halved.end);
    if (halved.isEmpty() || !(t_last > t_first))
        return addStretch(scene, shells.layerOf(shell, 0), way, t_begin, t_end);

    // From region to region (Amanatides and Woo 1987, "A fast voxel traversal algorithm for ray tracing"); what lies before
    // and behind those that are halved, and regions one after the other that are halved as often, make one stretch.
    Vec3i region;
    Vec3d t_next, t_width;  // where the ray leaves the region along each axis, and from one to the next
    for (int axis = 0; axis < 3; ++axis) {
        const double at = origin[axis] + t_first * direction[axis];
        region[axis] = std::clamp(static_cast<int>(std::floor(at)), range.first[axis], range.end[axis] - 1);
        const double face = region[axis] + (direction[axis] > 0 ? 1 : 0);
        t_width[axis] = direction[axis] != 0 ? std::abs(1 / direction[axis]) : std::numeric_limits<double>::infinity();
        t_next[axis] = direction[axis] != 0 ? (face - origin[axis]) / direction[axis] : t_width[axis];
    }
    double t_stretch = t_begin;
    int halvings = 0;
    const auto goOn = [&](int next_halvings, double t) {
        if (next_halvings == halvings) return;
        if (t > t_stretch) addStretch(scene, shells.layerOf(shell, halvings), way, t_stretch, t);
        t_stretch = std::max(t, t_stretch);
        halvings = next_halvings;
    };
    for (double t = t_first; t < t_last;) {
        goOn(regions->at(shell, region), t);
        int axis;
        t = t_next.minCoeff(&axis);
        t_next[axis] += t_width[axis];
        region[axis] += direction[axis] > 0 ? 1 : -1;
        if (region[axis] < range.first[axis] || region[axis] >= range.end[axis]) break;
    }
    goOn(0, t_last);
    if (t_end > t_stretch) addStretch(scene, shells.layerOf(shell, halvings), way, t_stretch, t_end);
}

void RayTracer::addStretch(const TraceScene& scene, int layer, const Way& way, double t_begin, double t_end) {
    const auto s = static_cast<std::size_t>(n_stretches_++);
    if (ox_.size() < s + 1 + kPadding) {
        const std::size_t size = (s + 1 + kPadding) * 3 / 2;
        for (auto* array : {&ox_, &oy_, &oz_, &dx_, &dy_, &dz_, &length_, &offset_, &scale_, &t_begin_})
            array->resize(size);
        for (auto* array : {&next_, &ray_}) array->resize(size);
    }
    const double scale = scene.shells.layerScale(layer);
    const Vec3d entry = scene.shells.fromInner(layer, way.origin + way.direction * t_begin);
    ox_[s] = inSameCell(entry.x()), dx_[s] = static_cast<float>(way.direction.x());
    oy_[s] = inSameCell(entry.y()), dy_[s] = static_cast<float>(way.direction.y());
    oz_[s] = inSameCell(entry.z()), dz_[s] = static_cast<float>(way.direction.z());
    length_[s] = static_cast<float>((t_end - t_begin) / scale);
    offset_[s] = way.offset;
    scale_[s] = static_cast<float>(scale);
    t_begin_[s] = static_cast<float>(t_begin - way.t_entry);
    ray_[s] = n_rays_ - 1;
}

void RayTracer::trace(const TraceScene& scene, const TraceOptions& options, KeptSamples& kept) {
    const int channels = scene.bricks.channels;
    tau_scale_ = static_cast<float>(std::min(
        scene.density_scale * scene.frame.voxel_size * static_cast<double>(options.step_voxels), kMostTauScale));
    const RayTile stretches{n_stretches_,   ox_.data(),     oy_.data(),  oz_.data(), dx_.data(), dy_.data(),
                            dz_.data(),     length_.data(), offset_.data(), next_.data()};
    const SampleArrays samples{leaf_.data(), cell_.data(), x_.data(), y_.data(), z_.data(), t_.data()};

    kept.n = 0;
    int n_alive = 0;
    for (int r = 0; r < n_rays_; ++r) {
        light_[r] = 1;
        dropped_[r] = 0;
        has_met_[r] = 0;
        if (first_stretch_[r] < first_stretch_[r + 1]) alive_[n_alive++] = first_stretch_[r];
    }
    std::fill_n(next_.begin(), n_stretches_, 0);
    counters_.rays += static_cast<std::uint64_t>(n_rays_);
    while (n_alive > 0) {
        const int n = simd::marchRays(scene.bricks, stretches, options.step_voxels, kStepsPerRound, alive_.data(),
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
            const int s = alive_[a], r = ray_[s];
            CompositeRay light{light_[r]};
            float dropped = dropped_[r];
            for (int i = begin_[a]; i < begin_[a + 1] && light.transmittance >= options.stop_transmittance; ++i) {
                const float weight = light.add(alpha_[i], decay_[i]);
                if (weight < options.min_weight && dropped + weight <= options.max_dropped) {
                    dropped += weight;
                    continue;
                }
                kept.leaf[k] = leaf_[i], kept.cell[k] = cell_[i], kept.ray[k] = r;
                kept.x[k] = x_[i], kept.y[k] = y_[i], kept.z[k] = z_[i];
                kept.t[k] = t_begin_[s] + scale_[s] * t_[i];
                kept.weight[k] = weight, kept.tau[k] = tau_[i];
                kept.transmittance[k] = static_cast<float>(light.transmittance);
                ++k;
            }
            light_[r] = light.transmittance, dropped_[r] = dropped;
            has_met_[r] |= begin_[a] < begin_[a + 1];
            if (light.transmittance < options.stop_transmittance) continue;
            if (next_[s] >= 0) alive_[n_left++] = s;
            else if (s + 1 < first_stretch_[r + 1]) alive_[n_left++] = s + 1;
        }
        kept.n = k;
        n_alive = n_left;
    }
    counters_.rays_skipped +=
        static_cast<std::uint64_t>(std::count(has_met_.begin(), has_met_.begin() + n_rays_, std::uint8_t{0}));

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

void RayTracer::addDistortionSlopes(const TraceScene& scene, float dl_ddistortion, const KeptSamples& kept) {
    const auto side = static_cast<float>(scene.shells.extent.maxCoeff());
    const auto distance = [side](float t) { return t <= side ? t / side : 1 + std::log(t / side); };
    const float reach = distortionReach(scene.shells.count);
    const auto rays = static_cast<std::size_t>(n_rays_);

    // dD_dw_i = 2 sum_j w_j d(|s_i - s_j|): those in front on the way there, those behind on the way back.
    spread_.assign(rays, {});
    last_distance_.assign(rays, 0.0f);
    distance_decay_.resize(static_cast<std::size_t>(kept.n));
    distortion_ = 0;
    for (int i = 0; i < kept.n; ++i) {
        const auto r = static_cast<std::size_t>(kept.ray[i]);
        const float s = distance(kept.t[i]);
        distance_decay_[i] = std::exp((last_distance_[r] - s) / reach);
        last_distance_[r] = s;
        const float slope = 2 * reach * spread_[r].add(kept.weight[i], distance_decay_[i]);
        distortion_ += static_cast<double>(kept.weight[i] * slope);
        slope_[i] += dl_ddistortion * slope;
    }
    spread_.assign(rays, {});
    decay_behind_.assign(rays, 1.0f);
    for (int i = kept.n; i-- > 0;) {
        const auto r = static_cast<std::size_t>(kept.ray[i]);
        slope_[i] += dl_ddistortion * 2 * reach * spread_[r].add(kept.weight[i], decay_behind_[r]);
        decay_behind_[r] = distance_decay_[i];
    }
}

void RayTracer::traceBackward(const TraceScene& scene, float* dl_dray_features, const float* dl_dtransmittance,
                              float dl_ddistortion, KeptSamples& kept) {
    if (slope_.size() < static_cast<std::size_t>(kept.n + kPadding))
        slope_.resize(static_cast<std::size_t>(kept.n + kPadding) * 3 / 2);
    addFeatureSlopes(scene.bricks.channels, dl_dray_features, kept);
    addDistortionSlopes(scene, dl_ddistortion, kept);
    behind_.clear();
    for (int r = 0; r < n_rays_; ++r) behind_.emplace_back(transmittance_[r], dl_dtransmittance[r]);
    for (int i = kept.n; i-- > 0;) {
        const float dl_dtau = behind_[kept.ray[i]].add(kept.weight[i], kept.transmittance[i], slope_[i]);
        kept.dl_draw[i] = (scene.holds_sigma ? tau_scale_ : kept.tau[i]) * dl_dtau;  // d tau / d raw = tau
    }
}

}  // namespace nerfvdb
