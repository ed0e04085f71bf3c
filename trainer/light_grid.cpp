// SPDX-License-Identifier: Apache-2.0
#include "trainer/light_grid.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr double kCell = 0.02;                  // world units
constexpr double kSeenDepth = 0.15;             // deeper inside a body no light comes from
constexpr LightGrid::Light kUnlit{-1.0, -1.0};  // a corner that no visible point reads

/// Share of the sun: the narrowest gap on the way to it, as an angle (Quilez, "Soft shadows in raymarched
/// SDFs").
double sunShare(const SolidScene& scene, const Vec3d& from) {
    constexpr double kSharpness = 8.0, kReach = 2.0;
    double share = 1.0;
    for (double t = 0.03; t < kReach && share > 0.0;) {
        const double d = scene.distance(from + t * sunDirection());
        share = std::min(share, kSharpness * d / t);
        t += std::clamp(d, 0.01, 0.1);
    }
    return smoothStep(std::max(share, 0.0));
}

/// Share of the sky: how much nearer other surfaces are than they would be over an open plane, at growing
/// distances along the normal (Evans 2006, "Fast approximations for global illumination on dynamic scenes").
double skyShare(const SolidScene& scene, const Vec3d& surface, const Vec3d& slope) {
    const double steepness = std::max(slope.norm(), 0.3);
    const Vec3d normal = slope.normalized();
    double closed = 0.0, weight = 1.0;
    for (double h = 0.03; h < 0.3; h *= 1.7) {
        closed += weight * std::max(1.0 - scene.distance(surface + h * normal) / (steepness * h), 0.0);
        weight *= 0.8;
    }
    return std::clamp(1.0 - 0.42 * closed, 0.0, 1.0);
}

}  // namespace

LightGrid::LightGrid(const SolidScene& scene)
    : origin_(scene.bounds().min),
      dims_((scene.bounds().size() / kCell).array().ceil().cast<int>() + 1),
      lights_(static_cast<std::size_t>(dims_.prod()), kUnlit) {
    forEachCorner([&](const Vec3i& corner, Light& light) {
        Vec3d point = origin_ + kCell * corner.cast<double>();
        const double d = scene.distance(point);
        if (d > 2.0 * kCell + scene.edge() || d < -kSeenDepth) return;
        // Corners inside a body would be dark: go to the nearest surface first. Several steps, because a
        // distance may be an underestimate.
        for (int i = 0; i < 5; ++i) point -= scene.distance(point) * scene.normal(point);
        const Vec3d slope = scene.slope(point);
        light = {sunShare(scene, point + 0.01 * slope), skyShare(scene, point, slope)};
    });
    for (int axis = 0; axis < 3; ++axis) smooth(axis);
    for (Light& light : lights_)
        if (light.sky == kUnlit.sky) light = Light{};
}

template <typename Body>
void LightGrid::forEachCorner(const Body& body) {
    parallelFor(static_cast<std::size_t>(dims_.z()), [&](std::size_t layer) {
        const int z = static_cast<int>(layer);
        for (int y = 0; y < dims_.y(); ++y)
            for (int x = 0; x < dims_.x(); ++x) body(Vec3i(x, y, z), lights_[offset({x, y, z})]);
    });
}

/// Weights 1 2 1 along an axis, over those corners that were lit; without it single corners in a crease show.
void LightGrid::smooth(int axis) {
    const std::vector<Light> before = lights_;
    forEachCorner([&](const Vec3i& corner, Light& light) {
        if (light.sky == kUnlit.sky) return;
        Light sum{0.0, 0.0};
        double weights = 0.0;
        for (int step = -1; step <= 1; ++step) {
            const Vec3i near = corner + step * Vec3i::Unit(axis);
            if (near[axis] < 0 || near[axis] >= dims_[axis]) continue;
            const Light& other = before[offset(near)];
            if (other.sky == kUnlit.sky) continue;
            const double weight = step == 0 ? 2.0 : 1.0;
            sum.sun += weight * other.sun;
            sum.sky += weight * other.sky;
            weights += weight;
        }
        light = {sum.sun / weights, sum.sky / weights};
    });
}

LightGrid::Light LightGrid::at(const Vec3d& point) const {
    const Vec3d index = (point - origin_) / kCell;
    const Vec3i low = index.array().floor().cast<int>().cwiseMax(0).cwiseMin(dims_.array() - 2);
    const Vec3d w = (index - low.cast<double>()).cwiseMax(0.0).cwiseMin(1.0);
    Light sum{0.0, 0.0};
    for (int corner = 0; corner < 8; ++corner) {
        const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
        const double weight = (x ? w.x() : 1 - w.x()) * (y ? w.y() : 1 - w.y()) * (z ? w.z() : 1 - w.z());
        const Light& light = lights_[offset(low + Vec3i(x, y, z))];
        sum.sun += weight * light.sun;
        sum.sky += weight * light.sky;
    }
    return sum;
}

}  // namespace nerfvdb
