// SPDX-License-Identifier: Apache-2.0
// Signed distances to simple solids, negative inside. Every function here is 1-Lipschitz, and smooth unions and
// intersections keep that: the value never exceeds the distance to the surface, which is what lets rays skip.
// Forms: Hart 1996, "Sphere tracing"; Quilez, "Distance functions" and "Smooth minimum".
#pragma once

#include <algorithm>
#include <cmath>

#include "core/types.h"

namespace nerfvdb {

/// Length of (x, y). Scenes are of size one: std::hypot's care for overflow would cost ten times as much.
inline double length(double x, double y) { return std::sqrt(x * x + y * y); }

inline double ballDistance(const Vec3d& p, double radius) { return p.norm() - radius; }

/// Ring about the z axis.
inline double torusDistance(const Vec3d& p, double ring_radius, double tube_radius) {
    return length(length(p.x(), p.y()) - ring_radius, p.z()) - tube_radius;
}

/// Cylinder about the z axis with edges rounded by `rounding`, which is part of radius and half_height.
inline double discDistance(const Vec3d& p, double radius, double half_height, double rounding) {
    const double x = length(p.x(), p.y()) - (radius - rounding);
    const double y = std::abs(p.z()) - (half_height - rounding);
    return std::min(std::max(x, y), 0.0) + length(std::max(x, 0.0), std::max(y, 0.0)) - rounding;
}

/// Derivative of discDistance.
inline Vec3d discSlope(const Vec3d& p, double radius, double half_height, double rounding) {
    const double r = length(p.x(), p.y());
    const Vec3d outwards = r > 0.0 ? Vec3d(p.x() / r, p.y() / r, 0.0) : Vec3d::Zero();
    const Vec3d upwards(0.0, 0.0, p.z() < 0.0 ? -1.0 : 1.0);
    const double x = r - (radius - rounding), y = std::abs(p.z()) - (half_height - rounding);
    if (x > 0.0 && y > 0.0) return (x * outwards + y * upwards) / length(x, y);
    return x > y ? outwards : upwards;
}

/// Box with edges rounded by `rounding`, which is part of half_size.
inline double boxDistance(const Vec3d& p, const Vec3d& half_size, double rounding) {
    const Vec3d q = p.cwiseAbs() - half_size + Vec3d::Constant(rounding);
    return std::min(q.maxCoeff(), 0.0) + q.cwiseMax(0.0).norm() - rounding;
}

/// Union and intersection whose seams are rounded over a length `k`.
inline double smoothUnion(double a, double b, double k) {
    const double h = std::max(k - std::abs(a - b), 0.0) / k;
    return std::min(a, b) - 0.25 * k * h * h;
}
inline double smoothIntersection(double a, double b, double k) { return -smoothUnion(-a, -b, k); }

/// Share of b's slope in the slope of smoothIntersection(a, b, k); a has the rest.
inline double smoothIntersectionShare(double a, double b, double k) {
    const double h = 0.5 * std::max(k - std::abs(a - b), 0.0) / k;
    return b > a ? 1.0 - h : h;
}

/// 0 below 0, 1 above 1, between them the polynomial 6x^5 - 15x^4 + 10x^3 with two continuous derivatives.
inline double smoothStep(double x) {
    x = std::clamp(x, 0.0, 1.0);
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0);
}

}  // namespace nerfvdb
