// SPDX-License-Identifier: Apache-2.0
#include "core/camera.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using Catch::Contains;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A camera as a phone's: long lens terms, odd principal point, a pose that is nothing special.
Camera phoneCamera() {
    Camera camera;
    camera.width = 1080;
    camera.height = 1920;
    camera.fx = 1375.52;
    camera.fy = 1374.49;
    camera.cx = 554.558;
    camera.cy = 965.268;
    camera.distortion = {0.0578421, -0.0805099, 0.01, -0.000980296, 0.00015575};
    camera.world_from_camera = Eigen::AngleAxisd(1.1, Vec3d(1, 2, -0.5).normalized()).toRotationMatrix();
    camera.position = Vec3d(3.1, -5.4, 0.9);
    return camera;
}

Distortion fisheyeOf(double k1, double k2, double k3, double k4) {
    return {k1, k2, k3, 0, 0, k4, 0, 0, LensModel::fisheye};
}

double unitRandom(std::uint64_t index) {
    return unitFloat(static_cast<std::uint32_t>(randomBits(7, 0, index)));
}

}  // namespace

TEST_CASE("the central ray of a pinhole looks along -z, right and up where they belong", "[core]") {
    Camera camera;
    camera.width = 4;
    camera.height = 2;
    camera.fx = camera.fy = 2;
    camera.cx = 2;
    camera.cy = 1;
    CHECK(cameraRay(camera, 2, 1).direction == Vec3d(0, 0, -1));
    // The right edge is (4 - 2) / 2 = 1 to the right at depth 1; the upper edge 1 / 2 up.
    CHECK((cameraRay(camera, 4, 1).direction - Vec3d(1, 0, -1).normalized()).norm() < 1e-15);
    CHECK((cameraRay(camera, 2, 0).direction - Vec3d(0, 0.5, -1).normalized()).norm() < 1e-15);
}

TEST_CASE("the lens model is OpenCV's", "[core]") {
    Camera camera = phoneCamera();
    camera.world_from_camera.setIdentity();
    camera.position.setZero();
    camera.distortion = {0.1, 0.2, 0.3, 0.01, 0.02};
    // By hand for x = 0.3, y = 0.1 (y down), r^2 = 0.1: radial = 1 + 0.01 + 0.002 + 0.0003 = 1.0123;
    // x_d = 0.30369 + 2 0.01 0.03 + 0.02 (0.1 + 0.18) = 0.30989
    // y_d = 0.10123 + 0.01 (0.1 + 0.02) + 2 0.02 0.03 = 0.10363
    const auto pixel = projectPoint(camera, Vec3d(0.3, -0.1, -1));
    REQUIRE(pixel);
    CHECK(pixel->x() == Approx(camera.cx + camera.fx * 0.30989).epsilon(1e-14));
    CHECK(pixel->y() == Approx(camera.cy + camera.fy * 0.10363).epsilon(1e-14));
}

TEST_CASE("projecting a point on a pixel's ray gives the pixel back", "[core]") {
    Camera camera = phoneCamera();
    const int kind = GENERATE(0, 1, 2, 3, 4, 5, 6);
    if (kind == 0) camera.distortion = {};
    if (kind == 2) camera.distortion = {-0.25, 0.06, 0, 0.002, -0.001};  // a barrel, as of an action camera
    if (kind == 3) camera.distortion = {0.3, 0.1, 0.05, 0, 0};           // a cushion
    if (kind == 4) camera.distortion = {0.9, 0.4, 0.01, 0.001, -0.001, 0.95, 0.7, 0.1};      // rational
    if (kind == 5) camera.distortion = fisheyeOf(-0.03, 0.004, -0.001, 0.0002);
    if (kind == 6) camera.distortion = fisheyeOf(0.02, 0.001, 0, 0), camera.fx = camera.fy = 500;  // corners at 120 degrees
    REQUIRE(cameraProblem(camera).empty());

    double worst = 0;
    int backward = 0;
    for (int i = 0; i < 1000; ++i) {
        const double px = camera.width * unitRandom(3 * i), py = camera.height * unitRandom(3 * i + 1);
        const Ray ray = cameraRay(camera, px, py);
        CHECK(std::abs(ray.direction.norm() - 1) < 1e-15);
        const auto pixel =
            projectPoint(camera, ray.origin + (0.1 + 10 * unitRandom(3 * i + 2)) * ray.direction);
        REQUIRE(pixel);
        worst = std::max(worst, (*pixel - Vec2d(px, py)).norm());
        backward += ray.direction.dot(camera.world_from_camera.col(2)) > 0;
    }
    CHECK((backward > 100) == (kind == 6));
    // Coordinates of 2000 pixels carry 2000 * 2^-53 = 2e-13 px of rounding per operation; about 30 operations.
    CHECK(worst < 1e-11);
}

TEST_CASE("points behind the camera or beyond the lens's fold have no pixel", "[core]") {
    Camera camera = phoneCamera();
    const Vec3d forward = cameraRay(camera, camera.cx, camera.cy).direction;
    CHECK_FALSE(projectPoint(camera, camera.position - forward));
    CHECK_FALSE(projectPoint(camera, camera.position));

    // r (1 - 0.181 r^4) turns at r^4 = 1 / (5 * 0.181), r = 1.025; at r = 1.533 it is back at the centre.
    camera.distortion = {0, -0.181, 0, 0, 0};
    camera.world_from_camera.setIdentity();
    camera.position.setZero();
    CHECK(projectPoint(camera, Vec3d(1.0, 0, -1)));
    CHECK_FALSE(projectPoint(camera, Vec3d(1.05, 0, -1)));
    CHECK_FALSE(projectPoint(camera, Vec3d(1.533, 0, -1)));

    // r + k1 r^3 + k2 r^5 + k3 r^7 that falls in between and rises again: beyond the dip is beyond the fold.
    camera.distortion = {-1.0, 0.3, 0.1, 0, 0};
    CHECK(projectPoint(camera, Vec3d(0.5, 0, -1)));
    CHECK_FALSE(projectPoint(camera, Vec3d(1.5, 0, -1)));
}

TEST_CASE("a sphere is seen inside its disc of pixels", "[core]") {
    Camera camera = phoneCamera();
    const bool is_fisheye = GENERATE(false, true);
    if (is_fisheye) camera.distortion = fisheyeOf(0, 0, 0, 0), camera.fx = camera.fy = 400;
    if (!is_fisheye) camera.distortion = {}, camera.fx = camera.fy = 3000;  // near the axis a perspective's circles are round
    int behind = 0;
    for (int i = 0; i < 300; ++i) {
        const Ray ray = cameraRay(camera, camera.width * unitRandom(5 * i), camera.height * unitRandom(5 * i + 1));
        const double radius = 0.3, distance = 0.7 + 5 * unitRandom(5 * i + 2);
        const Vec3d center = ray.origin + distance * ray.direction;
        const auto disc = projectSphere(camera, center, radius);
        REQUIRE(disc);
        behind += ray.direction.dot(camera.world_from_camera.col(2)) > 0;
        double farthest = 0;
        for (int j = 0; j < 100; ++j) {
            const Vec3d normal = Vec3d(unitRandom(9000 + 3 * j) - 0.5, unitRandom(9001 + 3 * j) - 0.5,
                                       unitRandom(9002 + 3 * j) - 0.5).normalized();
            const auto pixel = projectPoint(camera, center + radius * normal);
            if (pixel) farthest = std::max(farthest, (*pixel - disc->center).norm());
        }
        CHECK(farthest <= disc->radius * (is_fisheye ? 1.0 : 1.05));
        CHECK((farthest > 0.3 * disc->radius || disc->radius > 1000));  // and is not much smaller
    }
    CHECK((behind > 30) == is_fisheye);
    const Vec3d forward = -camera.world_from_camera.col(2);
    CHECK_FALSE(projectSphere(camera, camera.position + 1.4 * forward, 1));
    if (!is_fisheye) CHECK_FALSE(projectSphere(camera, camera.position - 5 * forward, 1));
}

TEST_CASE("complaints about cameras name what is wrong", "[core]") {
    Camera camera = phoneCamera();
    CHECK(cameraProblem(camera).empty());

    SECTION("not a number") {
        camera.position.x() = kNaN;
        CHECK_THAT(cameraProblem(camera), Contains("pose is not finite"));
    }
    SECTION("scaled") {
        camera.world_from_camera *= 1.01;
        CHECK_THAT(cameraProblem(camera), Contains("not rigid"));
    }
    SECTION("four printed digits are still a rotation") {
        camera.world_from_camera = (camera.world_from_camera * 1e4).array().round().matrix() / 1e4;
        CHECK(cameraProblem(camera).empty());
    }
    SECTION("mirrored") {
        camera.world_from_camera.col(0) *= -1;
        CHECK_THAT(cameraProblem(camera), Contains("mirror"));
    }
    SECTION("zeros") {
        camera.world_from_camera.setZero();
        CHECK_THAT(cameraProblem(camera), Contains("not rigid"));
    }
    SECTION("focal length") {
        camera.fy = 0;
        CHECK_THAT(cameraProblem(camera), Contains("focal length"));
        camera.fy = std::numeric_limits<double>::infinity();
        CHECK_THAT(cameraProblem(camera), Contains("focal length"));
    }
    SECTION("size, and everything at once") {
        camera.width = 0;
        camera.fx = -1;
        camera.cx = kNaN;
        camera.distortion.p2 = kNaN;
        CHECK_THAT(cameraProblem(camera), Contains("size 0x1920") && Contains("focal length") &&
                                              Contains("principal point") &&
                                              Contains("distortion is not finite"));
    }
    SECTION("folding lens") {
        camera.distortion.k1 = -2;
        CHECK_THAT(cameraProblem(camera), Contains("folds"));
        camera.distortion = {0, 0, 0, 0, 0, /*k4=*/2};
        CHECK_THAT(cameraProblem(camera), Contains("folds"));
        camera.distortion = fisheyeOf(-0.6, 0.12, 0, 0);
        CHECK_THAT(cameraProblem(camera), Contains("folds"));
        camera.distortion = fisheyeOf(0, 0, 0, 0);
        CHECK(cameraProblem(camera).empty());
        camera.fx = camera.fy = 300;  // corners at 1103 / 300 = 3.7 rad: beyond straight behind
        CHECK_THAT(cameraProblem(camera), Contains("folds"));
    }
    SECTION("terms of another model") {
        camera.distortion = {0, 0, 0, 0.01, 0, 0, 0, 0, LensModel::fisheye};
        CHECK_THAT(cameraProblem(camera), Contains("fisheye lens with p1"));
        camera.distortion = {};
        camera.distortion.k6 = kNaN;
        CHECK_THAT(cameraProblem(camera), Contains("distortion is not finite"));
    }
}

TEST_CASE("a resized camera sees the same directions", "[core]") {
    const Camera camera = phoneCamera();
    const Camera half = resized(camera, 540, 960);
    CHECK(half.width == 540);
    CHECK(half.height == 960);
    const Vec3d difference = cameraRay(camera, 200, 300).direction - cameraRay(half, 100, 150).direction;
    CHECK(difference.norm() < 1e-15);
}

TEST_CASE("lookAt centres its target, keeps up up and spans the field of view", "[core]") {
    const Vec3d eye(1, 2, 3), target(-1, 0.5, 2);
    const Camera camera = lookAt(eye, target, Vec3d(0, 0, 1), 0.8, 200, 100);
    CHECK(cameraProblem(camera).empty());
    const auto centre = projectPoint(camera, target);
    REQUIRE(centre);
    CHECK((*centre - Vec2d(100, 50)).norm() < 1e-12);
    const auto above = projectPoint(camera, target + Vec3d(0, 0, 0.1));
    REQUIRE(above);
    CHECK(above->y() < 50);
    CHECK(above->x() == Approx(100));
    const double angle =
        std::acos(cameraRay(camera, 100, 0).direction.dot(cameraRay(camera, 100, 100).direction));
    CHECK(angle == Approx(0.8));

    // Straight down, `up` says nothing: any roll will do, but it must be a rotation.
    CHECK(cameraProblem(lookAt(Vec3d(0, 0, 5), Vec3d::Zero(), Vec3d(0, 0, 1), 1, 10, 10)).empty());
    CHECK_THROWS_AS(lookAt(eye, eye, Vec3d(0, 0, 1), 1, 10, 10), UsageError);
    CHECK_THROWS_AS(lookAt(eye, target, Vec3d(0, 0, 1), 0, 10, 10), UsageError);
}
