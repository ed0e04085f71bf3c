// SPDX-License-Identifier: Apache-2.0
#include "bench/ray_reference.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace nerfvdb {
namespace {

Exact cornerWeight(const ExactSample& sample, int corner) {
    return (corner & 4 ? sample.x : 1 - sample.x) * (corner & 2 ? sample.y : 1 - sample.y) *
           (corner & 1 ? sample.z : 1 - sample.z);
}

/// dD_dw_i of the distortion D = sum_i sum_j w_i w_j reach (1 - exp(-|s_i - s_j| / reach)), shells aside.
std::vector<Exact> spreadSlopes(const TraceScene& scene, const std::vector<ExactSample>& samples,
                                const ExactLight& light) {
    const Exact side = scene.shells.extent.maxCoeff(), reach = distortionReach(scene.shells.count);
    const auto distance = [&](std::size_t i) {
        const Exact s = samples[i].t / side;
        return s <= 1 ? s : 1 + std::log(s);
    };
    std::vector<Exact> slopes(samples.size());
    // sum_j w_j (1 - exp(-gap)) over those passed, where gaps add up: far - near. Each way once.
    const auto add = [&, far = Exact{0}, near = Exact{0}, last = Exact{0}](std::size_t i) mutable {
        near *= std::exp(-std::abs(distance(i) - last) / reach);
        last = distance(i);
        slopes[i] += 2 * reach * (far - near);
        far += light.weight[i], near += light.weight[i];
    };
    auto in_front = add, behind = add;
    for (std::size_t i = 0; i < samples.size(); ++i) in_front(i);
    for (std::size_t i = samples.size(); i-- > 0;) behind(i);
    return slopes;
}

}  // namespace

ExactMarch::ExactMarch(const TraceScene& scene, const Ray& ray, float step_voxels, float jitter)
    : scene_(scene), step_(step_voxels), offset_(jitter * step_voxels) {
    Exact enter = 0, leave = std::numeric_limits<Exact>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        origin_[axis] =
            (static_cast<Exact>(ray.origin[axis]) - scene.frame.origin[axis]) / scene.frame.voxel_size;
        direction_[axis] = ray.direction[axis];
        const Exact last = scene.shells.extent[axis];
        // Parallel to the face, or so nearly that no distance matters: inside or not. The box holds its lower
        // faces.
        if (!std::isfinite(1 / ray.direction[axis])) {
            if (origin_[axis] < 0 || origin_[axis] >= last) return;
            continue;
        }
        const Exact a = (0 - origin_[axis]) / direction_[axis], b = (last - origin_[axis]) / direction_[axis];
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
    if (!(leave > enter) || !std::isfinite(leave)) return;
    length_ = leave - enter, entry_ = enter;
    for (int axis = 0; axis < 3; ++axis) origin_[axis] += direction_[axis] * enter;
}

Exact ExactMarch::faceDistance(std::int64_t k) const {
    Exact least = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const Exact p = position(k, axis);
        least = std::min(least, std::abs(p - std::round(p)));
    }
    return least;
}

std::optional<ExactSample> ExactMarch::sample(std::int64_t k) const {
    const Bricks& bricks = scene_.bricks;
    std::int64_t cell[3];
    Exact fraction[3];
    for (int axis = 0; axis < 3; ++axis) {
        const Exact p = position(k, axis);
        cell[axis] = std::clamp(static_cast<std::int64_t>(std::floor(p)), std::int64_t{0},
                                static_cast<std::int64_t>(scene_.shells.extent[axis]) - 1);
        fraction[axis] = std::clamp(p - static_cast<Exact>(cell[axis]), Exact{0}, Exact{1});
    }
    const std::int32_t node = bricks.skip_nodes[((cell[0] >> 6) * bricks.node_dims[1] + (cell[1] >> 6)) *
                                                    bricks.node_dims[2] + (cell[2] >> 6)];
    if (node < 0) return std::nullopt;
    const std::int32_t leaf = bricks.skip_leaves[node * std::int64_t{512} + (cell[0] >> 3 & 7) * 64 +
                                                 (cell[1] >> 3 & 7) * 8 + (cell[2] >> 3 & 7)];
    if (leaf < 0) return std::nullopt;
    const int offset = static_cast<int>((cell[0] & 7) * 64 + (cell[1] & 7) * 8 + (cell[2] & 7));
    if (!(bricks.occupied[leaf * std::size_t{8} + static_cast<std::size_t>(offset >> 6)] >> (offset & 63) & 1))
        return std::nullopt;
    return ExactSample{leaf, offset, fraction[0], fraction[1], fraction[2], t(k)};
}

Exact ExactMarch::endPhase() const {
    const Exact steps = (length_ - offset_) / step_;
    return steps - std::floor(steps);
}

std::vector<ExactSample> ExactMarch::samples() const {
    std::vector<ExactSample> found;
    for (std::int64_t k = 0; t(k) < length_; ++k)
        if (const std::optional<ExactSample> at = sample(k)) found.push_back(*at);
    return found;
}

ExactLight exactLight(const TraceScene& scene, float step_voxels, const std::vector<ExactSample>& samples) {
    const int channels = scene.bricks.channels;
    const Exact scale = static_cast<Exact>(scene.density_scale) * scene.frame.voxel_size * step_voxels;
    ExactLight light;
    light.mean.assign(static_cast<std::size_t>(channels), 0);
    Exact depth = 0;
    for (const ExactSample& sample : samples) {
        Exact raw = 0;
        std::vector<Exact> features(static_cast<std::size_t>(channels), 0);
        for (int corner = 0; corner < 8; ++corner) {
            const std::size_t value = cornerIndex(scene.bricks, sample.leaf, sample.cell, corner);
            const Exact weight = cornerWeight(sample, corner);
            raw += weight * scene.bricks.density[value];
            for (int c = 0; c < channels; ++c)
                features[c] += weight * scene.bricks.features[value * channels + static_cast<std::size_t>(c)];
        }
        const Exact tau =
            (scene.holds_sigma ? raw : std::exp(std::min(raw, static_cast<Exact>(kMaxRaw)))) * scale;
        const Exact weight = light.transmittance * -std::expm1(-tau);
        light.transmittance *= std::exp(-tau);
        light.tau.push_back(tau);
        light.weight.push_back(weight);
        light.behind.push_back(light.transmittance);
        light.weight_sum += weight;
        depth += weight * sample.t;
        for (int c = 0; c < channels; ++c) light.mean[c] += weight * features[c];
        light.features.insert(light.features.end(), features.begin(), features.end());
    }
    if (light.weight_sum > 0) {
        light.depth = depth / light.weight_sum;
        for (Exact& mean : light.mean) mean /= light.weight_sum;
    }
    return light;
}

ExactGradient exactGradient(const TraceScene& scene, const std::vector<ExactSample>& samples,
                            const ExactLight& light, const std::vector<float>& dl_dmean,
                            float dl_dtransmittance, float dl_ddistortion) {
    const std::size_t n = samples.size(), channels = dl_dmean.size();
    const std::vector<Exact> spread = spreadSlopes(scene, samples, light);
    const Exact apart = 2 * static_cast<Exact>(distortionReach(scene.shells.count)) * light.weight_sum;  // at most

    std::vector<Exact> slope(n), terms(n);  // dl_dw_i and its terms' magnitudes
    ExactGradient gradient;
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t c = 0; c < channels; ++c) {
            const Exact f = light.features[i * channels + c], g = dl_dmean[c] / light.weight_sum;
            slope[i] += (f - light.mean[c]) * g;
            terms[i] += (std::abs(f) + std::abs(light.mean[c])) * std::abs(g);
        }
        slope[i] += dl_ddistortion * spread[i];
        terms[i] += std::abs(dl_ddistortion) * apart;
        gradient.largest_slope = std::max(gradient.largest_slope, terms[i]);
    }
    gradient.largest_slope = std::max(gradient.largest_slope, std::abs(static_cast<Exact>(dl_dtransmittance)));

    gradient.dl_draw.resize(n), gradient.magnitude.resize(n);
    Exact behind = light.transmittance * dl_dtransmittance, behind_terms = std::abs(behind);
    for (std::size_t i = n; i-- > 0;) {
        gradient.dl_draw[i] = light.tau[i] * (light.behind[i] * slope[i] - behind);
        gradient.magnitude[i] = light.tau[i] * (light.behind[i] * terms[i] + behind_terms);
        behind += light.weight[i] * slope[i];
        behind_terms += light.weight[i] * terms[i];
    }
    return gradient;
}

}  // namespace nerfvdb
