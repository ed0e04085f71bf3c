// SPDX-License-Identifier: Apache-2.0
// How a lens bends light: from a direction to a place on the sensor, and back.
// Here +x is right, +y down and +z along the axis, as lens models have them; places on the sensor are in units of the
// focal length, from the principal point.
#pragma once

#include <cstdint>
#include <optional>

#include "core/types.h"

namespace nerfvdb {

/// What a lens makes of the angle theta between light and axis, before its flaws: perspective puts it at tan(theta),
/// a fisheye at theta (equidistant).
enum class LensModel : std::uint8_t { perspective = 0, fisheye = 1 };

/// Lens distortion as OpenCV has it, which is COLMAP's too (FULL_OPENCV and the models that it contains, or
/// OPENCV_FISHEYE and those).
///
/// perspective (Brown-Conrady with Claus and Fitzgibbon's denominator), x and y at unit distance, r^2 = x^2 + y^2:
///   radial = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
///   x_d = x radial + 2 p1 x y + p2 (r^2 + 2 x^2)
///   y_d = y radial + p1 (r^2 + 2 y^2) + 2 p2 x y
/// fisheye (Kannala and Brandt 2006, "A generic camera model and calibration method", eq. 6), without p1, p2, k5, k6:
///   theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8),  x_d = theta_d x / r,  y_d = theta_d y / r
/// where theta may exceed 90 degrees: such light comes from behind the plane of the sensor.
struct Distortion {
    double k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0;
    double k4 = 0, k5 = 0, k6 = 0;
    LensModel model = LensModel::perspective;

    /// A pinhole, then.
    bool isZero() const {
        return model == LensModel::perspective && k1 == 0 && k2 == 0 && k3 == 0 && p1 == 0 && p2 == 0 && k4 == 0 &&
               k5 == 0 && k6 == 0;
    }
};

/// Where light from a point (or along the way back to it) falls; the length of `point` does not matter. Nothing when
/// this lens cannot see it: behind a perspective lens, straight behind a fisheye, and wherever the model folds back,
/// so that it would land among light from elsewhere.
std::optional<Vec2d> distort(const Distortion& lens, const Vec3d& point);

/// The direction that falls on this place, of any length; the inverse of distort by Newton's method. Where no
/// direction does, the result is some direction: distort tells.
Vec3d undistort(const Distortion& lens, const Vec2d& place);

}  // namespace nerfvdb
