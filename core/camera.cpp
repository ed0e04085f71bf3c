// SPDX-License-Identifier: Apache-2.0
// Lens models have y down and z forward, the camera frame y up and z backward: both change sign between the two.
#include "core/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// A rotation printed with four digits is off by 1e-4; a pose that is scaled by 1 % is a different camera.
constexpr double kRigidTolerance = 1e-3;

/// Walks the image's border, where distortion is strongest, and looks for pixels that no direction reaches.
bool foldsInsideImage(const Camera& camera) {
    constexpr int kPointsPerEdge = 32;
    const auto isBad = [&](double px, double py) {
        const Vec2d place((px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy);
        const std::optional<Vec2d> back = distort(camera.distortion, undistort(camera.distortion, place));
        // A thousandth of a pixel: Newton either converges far below this or not at all.
        return !back || !((*back - place).cwiseProduct(Vec2d(camera.fx, camera.fy)).norm() < 1e-3);
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
    const Vec3d seen = undistort(camera.distortion, {(px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy});
    const Vec3d in_camera(seen.x(), -seen.y(), -seen.z());
    return {camera.position, (camera.world_from_camera * in_camera).normalized()};
}

std::optional<Vec2d> projectPoint(const Camera& camera, const Vec3d& point_in_world) {
    const Vec3d in_camera = camera.world_from_camera.transpose() * (point_in_world - camera.position);
    const auto place = distort(camera.distortion, {in_camera.x(), -in_camera.y(), -in_camera.z()});
    if (!place) return std::nullopt;
    return Vec2d(camera.cx + camera.fx * place->x(), camera.cy + camera.fy * place->y());
}

std::optional<PixelDisc> projectSphere(const Camera& camera, const Vec3d& center_in_world, double radius) {
    const Vec3d offset = center_in_world - camera.position;
    const double along_axis = -camera.world_from_camera.col(2).dot(offset);
    const double focal = std::max(camera.fx, camera.fy);
    if (camera.distortion.model == LensModel::perspective) {
        if (!(along_axis > 1.5 * radius)) return std::nullopt;
        const std::optional<Vec2d> pixel = projectPoint(camera, center_in_world);
        if (!pixel) return std::nullopt;
        return PixelDisc{*pixel, focal * radius / (along_axis - radius) + 1};
    }
    const double distance = offset.norm();
    if (!(distance > 1.5 * radius)) return std::nullopt;
    const std::optional<Vec2d> pixel = projectPoint(camera, center_in_world);
    if (!pixel) return std::nullopt;
    // An equidistant lens stretches circles about its axis by theta / sin(theta), without bound straight behind.
    const double angle = std::asin(radius / distance);
    const double theta = std::acos(std::clamp(along_axis / distance, -1.0, 1.0)) + angle;
    const double whole_image = (*pixel - Vec2d(camera.cx, camera.cy)).norm() + camera.width + camera.height;
    const double stretched = focal * angle * std::max(1.0, theta / std::sin(theta)) + 1;
    return PixelDisc{*pixel, theta < std::numbers::pi ? std::min(stretched, whole_image) : whole_image};
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
    const std::array lens_terms{d.k1, d.k2, d.k3, d.p1, d.p2, d.k4, d.k5, d.k6};
    bool lens_is_good = std::all_of(lens_terms.begin(), lens_terms.end(), [](double k) { return std::isfinite(k); });
    if (!lens_is_good) {
        complain() << "lens distortion is not finite";
    } else if (d.model == LensModel::fisheye && (d.p1 != 0 || d.p2 != 0 || d.k5 != 0 || d.k6 != 0)) {
        lens_is_good = false;
        complain() << "a fisheye lens with p1, p2, k5 or k6, which its model has not";
    }

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
