// SPDX-License-Identifier: Apache-2.0
#include "trainer/capture_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/support/catch.h"

using namespace nerfvdb;
using Catch::Contains;

namespace {

std::string number(int i) {
    char name[32];
    std::snprintf(name, sizeof name, "%02d.jpg", i);
    return name;
}

CaptureView viewAt(int i, const Vec3d& eye, const Vec3d& target) {
    return {number(i), lookAt(eye, target, Vec3d::UnitZ(), 0.8, 200, 200), false};
}

/// n cameras around the origin, at two heights.
std::vector<CaptureView> ring(int n) {
    std::vector<CaptureView> views;
    for (int i = 0; i < n; ++i) {
        const double angle = 2 * M_PI * i / n;
        views.push_back(viewAt(i, Vec3d(4 * std::cos(angle), 4 * std::sin(angle), i % 2 ? 1.0 : 2.5), Vec3d::Zero()));
    }
    return views;
}

bool warns(const CaptureReport& report, const std::string& words) {
    return std::any_of(report.warnings.begin(), report.warnings.end(),
                       [&](const std::string& line) { return line.find(words) != std::string::npos; });
}

}  // namespace

TEST_CASE("a good capture is described without a warning", "[trainer]") {
    const CaptureReport report = reportCapture(ring(24));
    for (const std::string& warning : report.warnings) UNSCOPED_INFO(warning);
    CHECK(report.warnings.empty());
    CHECK(report.usable == 24);
    CHECK(report.lenses == 1);
    REQUIRE(report.sizes.size() == 1);
    CHECK(report.sizes[0].views == 24);
    CHECK(report.camera_bounds.min.z() == Approx(1.0));
    CHECK(report.camera_bounds.max.x() == Approx(4.0));
    CHECK(report.position_rank == 3);
    CHECK(report.position_spread[0] == Approx(4 / std::sqrt(2.0)).epsilon(1e-3));
    CHECK(report.position_spread[2] == Approx(0.75).epsilon(1e-3));
    CHECK(report.middle.norm() < 1e-9);
    CHECK(report.see_middle == 24);
    // Across the ring, from 1 above and 1 above again (12 apart is even): the flattest pair.
    CHECK(report.widest_angle_deg == Approx(180 - 2 * std::atan2(1.0, 4.0) * 180 / M_PI).epsilon(1e-6));
    CHECK((report.unusable.empty() && report.alone.empty() && report.duplicates.empty()));
}

TEST_CASE("positions on a plane, on a line, in a point have fewer dimensions", "[trainer]") {
    std::vector<CaptureView> plane, line, point;
    for (int i = 0; i < 24; ++i) {
        const double x = 0.2 * (i % 6), z = 0.2 * (i / 6);
        plane.push_back(viewAt(i, Vec3d(x, -5, z), Vec3d(x, 0, z)));
        line.push_back(viewAt(i, Vec3d(0.2 * i, -5, 0.3 * i + 1e-3 * (i % 2)), Vec3d(2, 0, 3)));
        point.push_back(viewAt(i, Vec3d(1, 2, 3), Vec3d(1 + std::cos(0.2 * i), 2 + std::sin(0.2 * i), 3)));
    }
    CHECK(reportCapture(plane).position_rank == 2);
    CHECK(!warns(reportCapture(plane), "stand in"));
    CHECK(reportCapture(line).position_rank == 1);
    CHECK(warns(reportCapture(line), "the cameras stand in a line"));
    CHECK(reportCapture(point).position_rank == 0);
    CHECK(warns(reportCapture(point), "all cameras stand in one point"));
}

TEST_CASE("far from home a capture is described as at home", "[trainer]") {
    std::vector<CaptureView> views = ring(24);
    for (CaptureView& view : views) view.camera.position += Vec3d(5e6, -3e6, 200);
    const CaptureReport report = reportCapture(views);
    for (const std::string& warning : report.warnings) UNSCOPED_INFO(warning);
    CHECK(report.warnings.empty());
    CHECK(report.position_rank == reportCapture(ring(24)).position_rank);
    CHECK((report.middle - reportCapture(ring(24)).middle - Vec3d(5e6, -3e6, 200)).norm() < 1e-6);
}

TEST_CASE("cameras that are none are named, and the rest is described", "[trainer]") {
    std::vector<CaptureView> views = ring(24);
    views[3].camera.world_from_camera.col(0) *= -1;  // a mirror
    views[5].camera.world_from_camera *= 2;          // a scale
    views[7].camera.position.x() = std::nan("");
    const CaptureReport report = reportCapture(views);
    CHECK(report.usable == 21);
    REQUIRE(report.unusable.size() == 3);
    CHECK_THAT(report.unusable[0], Contains("03.jpg: pose is a mirror: determinant -1"));
    CHECK_THAT(report.unusable[1], Contains("05.jpg: pose is not rigid"));
    CHECK_THAT(report.unusable[2], Contains("07.jpg: pose is not finite"));
    CHECK(warns(report, "3 of 24 cameras are unusable"));
    CHECK(report.camera_bounds.max.allFinite());

    for (CaptureView& view : views) view.camera.position.y() = std::nan("");
    const CaptureReport none = reportCapture(views);
    CHECK(none.usable == 0);
    CHECK(none.warnings.size() == 1);
    CHECK(reportCapture({}).warnings.empty());
}

TEST_CASE("views that share nothing with others are found", "[trainer]") {
    std::vector<CaptureView> views = ring(24);
    views[4].camera = lookAt(Vec3d(4, 0, 2), Vec3d(4, 0.1, 9), Vec3d::UnitX(), 0.8, 200, 200);  // the sky
    const CaptureReport report = reportCapture(views);
    CHECK(report.alone == std::vector<std::string>{"04.jpg"});
    CHECK(warns(report, "1 of 24 views share nothing with any other: 04.jpg"));

    // World to camera where camera to world is meant: the usual mistake.
    std::vector<CaptureView> away;
    for (int i = 0; i < 3; ++i) {
        const double angle = 2 * M_PI * i / 3;
        const Vec3d out(std::cos(angle), std::sin(angle), 0);
        away.push_back(viewAt(i, 4 * out, 8 * out));
    }
    CHECK(reportCapture(away).alone.size() == 3);
    CHECK(reportCapture(away).see_middle == 0);
}

TEST_CASE("views that look past each other are told", "[trainer]") {
    std::vector<CaptureView> views;  // a walk around a house, looking outward: neighbours share something
    for (int i = 0; i < 40; ++i) {
        const double angle = 2 * M_PI * i / 40;
        const Vec3d out(std::cos(angle), std::sin(angle), i % 2 ? 0.1 : 0.0);
        views.push_back(viewAt(i, 4 * out, 8 * out));
    }
    const CaptureReport report = reportCapture(views);
    CHECK(report.alone.empty());
    CHECK(warns(report, "only 0 of 40 views see the middle"));
}

TEST_CASE("views from nearly one place are told", "[trainer]") {
    std::vector<CaptureView> views;
    for (int i = 0; i < 25; ++i)
        views.push_back(viewAt(i, Vec3d(0.25 * (i % 5), -10, 0.25 * (i / 5)), Vec3d(0.5, 0, 0.5)));
    CHECK(warns(reportCapture(views), "angles that differ by less than 10 degrees"));
}

TEST_CASE("parallel views have their middle ahead of them", "[trainer]") {
    std::vector<CaptureView> views;  // a drone over a field
    for (int i = 0; i < 25; ++i) {
        const Vec3d eye(2.0 * (i % 5), 2.0 * (i / 5), 10);
        views.push_back({number(i), lookAt(eye, eye - Vec3d::UnitZ(), Vec3d::UnitY(), 0.8, 200, 200), false});
    }
    const CaptureReport report = reportCapture(views);
    CHECK(report.middle.x() == Approx(4));
    CHECK(report.middle.z() == Approx(10 - 8 * std::sqrt(2.0)));
    CHECK(report.see_middle > 12);
    CHECK(report.warnings.empty());
}

TEST_CASE("poses that stand twice are told, in the order of the views", "[trainer]") {
    std::vector<CaptureView> views = ring(24);
    views[20].camera = views[2].camera;
    views[9].camera.world_from_camera = views[8].camera.world_from_camera;  // turned alike, elsewhere
    views[11].camera.position = views[10].camera.position;                  // there, turned otherwise
    const CaptureReport report = reportCapture(views);
    CHECK(report.duplicates == std::vector<std::string>{"02.jpg and 20.jpg"});
    CHECK(warns(report, "1 pairs of views have the same pose: 02.jpg and 20.jpg"));
}

TEST_CASE("sizes and lenses are counted", "[trainer]") {
    std::vector<CaptureView> views = ring(24);
    for (const int i : {1, 2, 3}) views[static_cast<std::size_t>(i)].camera.width = 210;
    views[4].camera.fx *= 1.5;
    const CaptureReport report = reportCapture(views);
    REQUIRE(report.sizes.size() == 2);
    CHECK(report.sizes[0].views == 21);
    CHECK(report.sizes[1].width == 210);
    CHECK(report.lenses == 3);
    CHECK(warns(report, "images of 2 sizes: 21 of 200x200, 3 of 210x200"));
    CHECK(warns(reportCapture(ring(12)), "only 12 views"));
}
