// SPDX-License-Identifier: Apache-2.0
// Cameras as photographs have them: a perspective or fisheye lens with its distortion, and a rigid pose.
// The camera frame is OpenGL's: +x right, +y up, looks along -z.
#pragma once

#include <optional>
#include <string>

#include "core/lens.h"
#include "core/types.h"

namespace nerfvdb {

/// x_in_world = position + direction * t, |direction| = 1, t in world units.
struct Ray {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d(0, 0, -1);
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

/// The ray through pixel coordinates (px, py), lens distortion undone by Newton's method. A fisheye's may look back.
Ray cameraRay(const Camera& camera, double px, double py);

/// Pixel coordinates of a world point, or nothing when no light from it passes the lens (see distort): behind a
/// perspective camera, or so far off the axis that the lens model folds back (it would land among pixels that never
/// saw it). The pixel may lie outside the image.
std::optional<Vec2d> projectPoint(const Camera& camera, const Vec3d& point_in_world);

/// Pixels outside of which no point of a sphere is seen: those within `radius` of `center`, pixels.
struct PixelDisc {
    Vec2d center;
    double radius;
};

/// Where a small sphere may be seen. Nothing when it cannot be, or when it is so near (its centre less than 1.5 radii
/// before the camera) that its outline is no small circle. What distortion, or a perspective far off its axis, adds to
/// its size is not counted.
std::optional<PixelDisc> projectSphere(const Camera& camera, const Vec3d& center_in_world, double radius);

/// Every complaint about a camera: non-finite or non-rigid pose, focal length or size not positive, terms that its
/// lens model has not, pixels that no direction reaches since the lens folds inside the image. Empty when it is usable.
std::string cameraProblem(const Camera& camera);

/// The same camera with an image of another size, principal point and focal lengths scaled with it.
Camera resized(const Camera& camera, int width, int height);

/// A camera at `eye` that looks at `target`, with a vertical field of view in radians.
/// Throws UsageError when eye and target coincide or the field of view is not in (0, pi).
Camera lookAt(const Vec3d& eye, const Vec3d& target, const Vec3d& up, double fov_y_rad, int width, int height);

}  // namespace nerfvdb
