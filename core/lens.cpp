// SPDX-License-Identifier: Apache-2.0
// A direction of a perspective lens is told by its point on the plane at unit distance, called `plane` here.
#include "core/lens.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/positive_polynomial.h"

namespace nerfvdb {
namespace {

// --- perspective ---------------------------------------------------------------------------------------------

struct Distorted {
    Vec2d point;
    Eigen::Matrix2d jacobian;  // d point / d plane
};

Distorted distortPlane(const Distortion& d, const Vec2d& plane) {
    const double x = plane.x(), y = plane.y();
    const double r2 = x * x + y * y;
    const double above = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    const double below = 1 + r2 * (d.k4 + r2 * (d.k5 + r2 * d.k6));
    const double dabove_dr2 = d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3);
    const double dbelow_dr2 = d.k4 + r2 * (2 * d.k5 + r2 * 3 * d.k6);
    const double radial = above / below;
    const double dradial_dr2 = (dabove_dr2 - radial * dbelow_dr2) / below;

    Distorted out;
    out.point.x() = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
    out.point.y() = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
    const double cross = 2 * x * y * dradial_dr2 + 2 * d.p1 * x + 2 * d.p2 * y;
    out.jacobian << radial + 2 * x * x * dradial_dr2 + 2 * d.p1 * y + 6 * d.p2 * x, cross,  //
        cross, radial + 2 * y * y * dradial_dr2 + 6 * d.p1 * y + 2 * d.p2 * x;
    return out;
}

/// True if the distorted radius grows all the way from 0 to this r^2. Beyond the first turning point the lens model
/// folds back: distant directions would land in the picture.
bool radiusGrowsUpTo(const Distortion& d, double r2) {
    if (d.k4 == 0 && d.k5 == 0 && d.k6 == 0)
        return isPositiveUpTo(std::array{1.0, 3 * d.k1, 5 * d.k2, 7 * d.k3}, r2);
    // d(r A/B)/dr = (A B + 2 u (A' B - A B')) / B^2 with u = r^2, and B may not change its sign on the way.
    const std::array above{1.0, d.k1, d.k2, d.k3}, below{1.0, d.k4, d.k5, d.k6};
    std::array<double, 7> slope{};
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j)
            slope[i + j] += (1 + 2 * (static_cast<double>(i) - static_cast<double>(j))) * above[i] * below[j];
    return isPositiveUpTo(below, r2) && isPositiveUpTo(slope, r2);
}

std::optional<Vec2d> distortPerspective(const Distortion& lens, const Vec3d& point) {
    if (!(point.z() > 0)) return std::nullopt;
    const Vec2d plane(point.x() / point.z(), point.y() / point.z());
    if (lens.isZero()) return plane;
    if (!radiusGrowsUpTo(lens, plane.squaredNorm())) return std::nullopt;
    const Distorted at = distortPlane(lens, plane);
    if (!(at.jacobian.determinant() > 0)) return std::nullopt;  // folded by p1 and p2
    return at.point;
}

/// Newton's method, quadratic: half a dozen steps reach machine precision wherever the model does not fold. A step
/// that leads away is halved, as the first ones of strong lenses may be.
Vec2d undistortPlane(const Distortion& lens, const Vec2d& place) {
    Vec2d plane = place;
    Distorted at = distortPlane(lens, plane);
    double residual = (place - at.point).squaredNorm();
    for (int i = 0; i < 30 && residual > 0; ++i) {
        Vec2d step = at.jacobian.inverse() * (place - at.point);
        const bool is_rounding = step.squaredNorm() < 1e-28 * (1 + plane.squaredNorm());
        const double before = residual;
        for (int tries = is_rounding ? 1 : 20; tries > 0; --tries, step *= 0.5) {
            const Distorted to = distortPlane(lens, plane + step);
            const double left = (place - to.point).squaredNorm();
            if (!(left < residual)) continue;
            plane += step;
            at = to;
            residual = left;
            break;
        }
        if (residual == before) break;
    }
    return plane;
}

// --- fisheye -------------------------------------------------------------------------------------------------

double fisheyeRadius(const Distortion& d, double theta) {
    const double u = theta * theta;
    return theta * (1 + u * (d.k1 + u * (d.k2 + u * (d.k3 + u * d.k4))));
}

double fisheyeSlope(const Distortion& d, double theta) {
    const double u = theta * theta;
    return 1 + u * (3 * d.k1 + u * (5 * d.k2 + u * (7 * d.k3 + u * 9 * d.k4)));
}

std::optional<Vec2d> distortFisheye(const Distortion& d, const Vec3d& point) {
    const double r = std::hypot(point.x(), point.y());
    if (r == 0) return point.z() > 0 ? std::optional<Vec2d>(Vec2d::Zero()) : std::nullopt;
    const double theta = std::atan2(r, point.z());
    if (!isPositiveUpTo(std::array{1.0, 3 * d.k1, 5 * d.k2, 7 * d.k3, 9 * d.k4}, theta * theta)) return std::nullopt;
    const double scale = fisheyeRadius(d, theta) / r;
    return Vec2d(scale * point.x(), scale * point.y());
}

/// The angle whose distorted one is theta_d; pi where none is so large. Newton's method between bounds.
double undistortAngle(const Distortion& d, double theta_d) {
    double low = 0, high = std::numbers::pi;
    double theta = std::min(theta_d, high);
    for (int i = 0; i < 100; ++i) {
        const double excess = fisheyeRadius(d, theta) - theta_d;
        const double slope = fisheyeSlope(d, theta);
        // Beyond a fold it falls again: what is sought lies before.
        (excess > 0 || !(slope > 0) ? high : low) = theta;
        double next = theta - excess / slope;
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        const double step = std::abs(next - theta);
        theta = next;
        if (step <= 1e-16 * theta) break;
    }
    return theta;
}

Vec3d undistortFisheye(const Distortion& d, const Vec2d& place) {
    const double theta_d = std::hypot(place.x(), place.y());
    if (theta_d == 0) return {0, 0, 1};
    const double theta = undistortAngle(d, theta_d);
    const double scale = std::sin(theta) / theta_d;
    return {scale * place.x(), scale * place.y(), std::cos(theta)};
}

}  // namespace

std::optional<Vec2d> distort(const Distortion& lens, const Vec3d& point) {
    return lens.model == LensModel::fisheye ? distortFisheye(lens, point) : distortPerspective(lens, point);
}

Vec3d undistort(const Distortion& lens, const Vec2d& place) {
    if (lens.model == LensModel::fisheye) return undistortFisheye(lens, place);
    const Vec2d plane = lens.isZero() ? place : undistortPlane(lens, place);
    return {plane.x(), plane.y(), 1.0};
}

}  // namespace nerfvdb
