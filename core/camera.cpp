// SPDX-License-Identifier: Apache-2.0
// Points on the image plane at unit distance are called `plane` here: x right, y down, as lens models and
// pixels have them; the camera frame's y is up, so y changes sign between the two.
#include "core/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <sstream>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// A rotation printed with four digits is off by 1e-4; a pose that is scaled by 1 % is a different camera.
constexpr double kRigidTolerance = 1e-3;

struct Distorted {
    Vec2d point;
    Eigen::Matrix2d jacobian;  // d point / d plane
};

Distorted distort(const Distortion& d, const Vec2d& plane) {
    const double x = plane.x(), y = plane.y();
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    const double dradial_dr2 = d.k1 + r2 * (2 * d.k2 + r2 * 3 * d.k3);

    Distorted out;
    out.point.x() = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
    out.point.y() = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
    const double cross = 2 * x * y * dradial_dr2 + 2 * d.p1 * x + 2 * d.p2 * y;
    out.jacobian << radial + 2 * x * x * dradial_dr2 + 2 * d.p1 * y + 6 * d.p2 * x, cross,  //
        cross, radial + 2 * y * y * dradial_dr2 + 6 * d.p1 * y + 2 * d.p2 * x;
    return out;
}

/// True if the distorted radius r (1 + k1 r^2 + k2 r^4 + k3 r^6) grows all the way from 0 to this r^2.
/// Beyond the first turning point the lens model folds back: distant directions would land in the picture.
bool growsUpTo(const Distortion& d, double r2) {
    const auto slope = [&](double u) { return 1 + u * (3 * d.k1 + u * (5 * d.k2 + u * 7 * d.k3)); };
    if (!(slope(r2) > 0)) return false;

    // The slope's own extremes: 3 k1 + 10 k2 u + 21 k3 u^2 = 0.
    const double a = 21 * d.k3, b = 10 * d.k2, c = 3 * d.k1;
    const auto turnsBefore = [&](double u) { return u > 0 && u < r2 && !(slope(u) > 0); };
    if (a == 0) return b == 0 || !turnsBefore(-c / b);
    const double discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return true;
    const double root = std::sqrt(discriminant);
    return !turnsBefore((-b - root) / (2 * a)) && !turnsBefore((-b + root) / (2 * a));
}

/// Inverse of distort by Newton's method; quadratic, so a dozen steps reach machine precision wherever the
/// model does not fold.
Vec2d undistort(const Distortion& d, const Vec2d& distorted) {
    Vec2d plane = distorted;
    for (int i = 0; i < 30; ++i) {
        const Distorted at = distort(d, plane);
        const Vec2d step = at.jacobian.inverse() * (distorted - at.point);
        if (!step.allFinite()) break;
        plane += step;
        if (step.squaredNorm() < 1e-32 * (1 + plane.squaredNorm())) break;
    }
    return plane;
}

Vec2d planeFromPixel(const Camera& camera, double px, double py) {
    const Vec2d distorted((px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy);
    return camera.distortion.isZero() ? distorted : undistort(camera.distortion, distorted);
}

/// Walks the image's border, where distortion is strongest, and looks for pixels that no direction reaches.
bool foldsInsideImage(const Camera& camera) {
    constexpr int kPointsPerEdge = 32;
    const auto isBad = [&](double px, double py) {
        const Vec2d plane = planeFromPixel(camera, px, py);
        const Distorted at = distort(camera.distortion, plane);
        const Vec2d pixel(camera.cx + camera.fx * at.point.x(), camera.cy + camera.fy * at.point.y());
        // A thousandth of a pixel: Newton either converges far below this or not at all.
        return !((pixel - Vec2d(px, py)).norm() < 1e-3) || !(at.jacobian.determinant() > 0) ||
               !growsUpTo(camera.distortion, plane.squaredNorm());
    };
    for (int i = 0; i <= kPointsPerEdge; ++i) {
        const double x = static_cast<double>(camera.width) * i / kPointsPerEdge;
        const double y = static_cast<double>(camera.height) * i / kPointsPerEdge;
        if (isBad(x, 0) || isBad(x, camera.height) || isBad(0, y) || isBad(camera.width, y)) return true;
    }
    return false;
}

}  // namespace

Ray cameraRay(const Camera& camera, double px, double py) {
    const Vec2d plane = planeFromPixel(camera, px, py);
    const Vec3d in_camera(plane.x(), -plane.y(), -1.0);
    return {camera.position, (camera.world_from_camera * in_camera).normalized()};
}

std::optional<Vec2d> projectPoint(const Camera& camera, const Vec3d& point_in_world) {
    const Vec3d in_camera = camera.world_from_camera.transpose() * (point_in_world - camera.position);
    const double depth = -in_camera.z();
    if (!(depth > 0)) return std::nullopt;
    Vec2d plane(in_camera.x() / depth, -in_camera.y() / depth);
    if (!camera.distortion.isZero()) {
        if (!growsUpTo(camera.distortion, plane.squaredNorm())) return std::nullopt;
        plane = distort(camera.distortion, plane).point;
    }
    return Vec2d(camera.cx + camera.fx * plane.x(), camera.cy + camera.fy * plane.y());
}

std::string cameraProblem(const Camera& camera) {
    std::ostringstream problems;
    const auto complain = [&]() -> std::ostream& { return problems << (problems.tellp() > 0 ? "; " : ""); };
    const Distortion& d = camera.distortion;

    const bool size_is_good = camera.width > 0 && camera.height > 0;
    if (!size_is_good)
        complain() << "image size " << camera.width << "x" << camera.height << " is not positive";
    const bool focal_is_good =
        std::isfinite(camera.fx) && std::isfinite(camera.fy) && camera.fx > 0 && camera.fy > 0;
    if (!focal_is_good) complain() << "focal length (" << camera.fx << ", " << camera.fy << ") is not positive";
    const bool centre_is_good = std::isfinite(camera.cx) && std::isfinite(camera.cy);
    if (!centre_is_good) complain() << "principal point is not finite";
    const bool lens_is_good = std::isfinite(d.k1) && std::isfinite(d.k2) && std::isfinite(d.k3) &&
                              std::isfinite(d.p1) && std::isfinite(d.p2);
    if (!lens_is_good) complain() << "lens distortion is not finite";

    if (!camera.position.allFinite() || !camera.world_from_camera.allFinite()) {
        complain() << "pose is not finite";
    } else {
        const Mat3d& rotation = camera.world_from_camera;
        const double skew = (rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff();
        if (!(skew <= kRigidTolerance))
            complain() << "pose is not rigid: R^T R differs from the identity by " << skew << " (at most "
                       << kRigidTolerance << ")";
        else if (rotation.determinant() < 0)
            complain() << "pose is a mirror: determinant " << rotation.determinant() << " instead of 1";
    }

    if (size_is_good && focal_is_good && centre_is_good && lens_is_good && !d.isZero() &&
        foldsInsideImage(camera))
        complain() << "lens distortion folds inside the image";
    return problems.str();
}

Camera resized(const Camera& camera, int width, int height) {
    const double scale_x = static_cast<double>(width) / camera.width;
    const double scale_y = static_cast<double>(height) / camera.height;
    Camera result = camera;
    result.width = width;
    result.height = height;
    result.fx *= scale_x;
    result.cx *= scale_x;
    result.fy *= scale_y;
    result.cy *= scale_y;
    return result;
}

Camera lookAt(const Vec3d& eye, const Vec3d& target, const Vec3d& up, double fov_y_rad, int width, int height) {
    if (!(fov_y_rad > 0 && fov_y_rad < M_PI))
        throw UsageError("lookAt", "a field of view of " + std::to_string(fov_y_rad) + " rad", "0 to pi");
    const Vec3d backward = (eye - target).normalized();
    if (!((eye - target).norm() > 0) || !backward.allFinite())
        throw UsageError("lookAt", "an eye at its target", "two different points");
    Vec3d right = up.cross(backward);
    // Straight up or down every roll is as good as another: take the axis most different from the view.
    if (!(right.norm() > 1e-9 * up.norm())) right = backward.unitOrthogonal();
    right.normalize();

    Camera camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * fov_y_rad);
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    camera.world_from_camera << right, backward.cross(right), backward;
    camera.position = eye;
    return camera;
}

}  // namespace nerfvdb
