// SPDX-License-Identifier: Apache-2.0
#include "bench/capture_plot.h"

#include <Eigen/Geometry>
#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/xml_check.h"

using namespace nerfvdb;
using Catch::Contains;

namespace {

std::vector<CaptureView> ring(int n, const Vec3d& up) {
    std::vector<CaptureView> views;
    for (int i = 0; i < n; ++i) {
        const double angle = 2 * M_PI * i / n;
        const Vec3d x = up.unitOrthogonal(), y = up.cross(x);
        const Vec3d eye = 4 * std::cos(angle) * x + 4 * std::sin(angle) * y + up;
        views.push_back({"a<" + std::to_string(i) + ">", lookAt(eye, Vec3d::Zero(), up, 0.8, 200, 100), i % 8 == 0});
    }
    return views;
}

int countOf(const std::string& text, const std::string& part) {
    int n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
    return n;
}

const Box kUnitBox{-Vec3d::Ones(), Vec3d::Ones()};

}  // namespace

TEST_CASE("up is the world axis that cameras hold up, or their own mean", "[bench]") {
    CHECK(upOfCameras(ring(12, Vec3d::UnitZ())) == Vec3d::UnitZ());
    CHECK(upOfCameras(ring(12, -Vec3d::UnitY())) == Vec3d(-Vec3d::UnitY()));
    const Vec3d oblique = Vec3d(1, 1, 1).normalized();
    CHECK((upOfCameras(ring(12, oblique)) - oblique).norm() < 1e-9);
    CHECK(upOfCameras({}) == Vec3d::UnitZ());
}

TEST_CASE("cameras are drawn from above and from the side, whatever they are called", "[bench]") {
    const std::vector<CaptureView> views = ring(16, Vec3d::UnitZ());
    const std::string svg = svgText({"my & data", kUnitBox, Vec3d::Zero()}, views);
    CHECK(nerfvdb::test::xmlProblem(svg) == "");
    CHECK_THAT(svg, Contains("from above: x to the right, y up") && Contains("from the side: x to the right, z up") &&
                        Contains("my &amp; data") && Contains("<title>a&lt;8&gt; (held out)</title>"));
    CHECK(countOf(svg, "<g stroke=\"#2f7fd6\">") == 2 * 14);
    CHECK(countOf(svg, "<g stroke=\"#e0832a\">") == 2 * 2);
    CHECK(countOf(svg, "class=\"box\"") == 2);
    CHECK_THAT(svg, Contains("2 world units"));
    CHECK(svg == svgText({"my & data", kUnitBox, Vec3d::Zero()}, views));
}

TEST_CASE("awkward captures make a picture too", "[bench]") {
    std::vector<CaptureView> views = ring(3, Vec3d(1, 1, 1).normalized());
    CHECK(nerfvdb::test::xmlProblem(svgText({"oblique", std::nullopt, Vec3d::Zero()}, views)) == "");
    views[1].camera.position.x() = std::nan("");
    const std::string svg = svgText({"huge box", Box{-1e6 * Vec3d::Ones(), 1e6 * Vec3d::Ones()}, Vec3d::Zero()}, views);
    CHECK(nerfvdb::test::xmlProblem(svg) == "");
    CHECK_THAT(svg, !Contains("nan") && !Contains("inf"));
    CHECK(countOf(svg, "<g stroke=") == 2 * 2);
    CHECK_THAT(svg, Contains("2 world units"));  // the cameras set the scale, not the box
    for (const int n : {0, 1})
        CHECK(nerfvdb::test::xmlProblem(svgText({"few", {}, Vec3d::Zero()}, ring(n, Vec3d::UnitZ()))) == "");
}
