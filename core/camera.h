// SPDX-License-Identifier: Apache-2.0
// Cameras as photographs have them: pinhole plus OPENCV lens distortion, and a rigid pose.
// The camera frame is OpenGL's: +x right, +y up, looks along -z.
#pragma once

#include <optional>
#include <string>

#include "core/types.h"

namespace nerfvdb {

/// x_in_world = position + direction * t, |direction| = 1, t in world units.
struct Ray {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d(0, 0, -1);
};

/// Brown-Conrady lens model as in OpenCV: with r^2 = x^2 + y^2 of the undistorted point (x right, y down),
///   x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
///   y_d = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
struct Distortion {
    double k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0;
    bool isZero() const { return k1 == 0 && k2 == 0 && k3 == 0 && p1 == 0 && p2 == 0; }
};

/// x_in_world = world_from_camera * x_in_camera + position.
/// Pixel coordinates are continuous, (0, 0) at the upper left corner; the first pixel's centre is (0.5, 0.5).
struct Camera {
    int width = 0, height = 0;      // pixels
    double fx = 0, fy = 0;          // focal lengths, pixels
    double cx = 0, cy = 0;          // principal point, pixels
    Distortion distortion;
    Mat3d world_from_camera = Mat3d::Identity();  // rotation
    Vec3d position = Vec3d::Zero();               // world units
};

/// The ray through pixel coordinates (px, py), lens distortion undone by Newton's method.
Ray cameraRay(const Camera& camera, double px, double py);

/// Pixel coordinates of a world point, or nothing when it is not in front of the camera, or so far off the axis
/// that the lens model folds back (it would land among pixels that never saw it).
/// The pixel may lie outside the image.
std::optional<Vec2d> projectPoint(const Camera& camera, const Vec3d& point_in_world);

/// Every complaint about a camera: non-finite or non-rigid pose, focal length or size not positive, a
/// distortion that folds inside the image. Empty when it is usable.
std::string cameraProblem(const Camera& camera);

/// The same camera with an image of another size, principal point and focal lengths scaled with it.
Camera resized(const Camera& camera, int width, int height);

/// A camera at `eye` that looks at `target`, with a vertical field of view in radians.
/// Throws UsageError when eye and target coincide or the field of view is not in (0, pi).
Camera lookAt(const Vec3d& eye, const Vec3d& target, const Vec3d& up, double fov_y_rad, int width, int height);

}  // namespace nerfvdb
