// SPDX-License-Identifier: Apache-2.0
// The scenes keep what their interface promises; what they look like is tested in exact_ray_test.cpp.
#include "trainer/synthetic_scene.h"

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "trainer/solid_scene.h"

using namespace nerfvdb;

namespace {

double unit(std::uint64_t stream, std::uint64_t index) {
    return (randomBits(7, stream, index) >> 11) * 0x1p-53;
}

Vec3d pointIn(const Box& box, std::uint64_t index) {
    return box.min + box.size().cwiseProduct(Vec3d(unit(0, index), unit(1, index), unit(2, index)));
}

Vec3d unitVector(std::uint64_t index) {
    const double z = 2 * unit(3, index) - 1, a = 6.283185307179586 * unit(4, index), r = std::sqrt(1 - z * z);
    return {r * std::cos(a), r * std::sin(a), z};
}

}  // namespace

TEST_CASE("an unknown scene name is answered with the names that exist", "[synthetic]") {
    REQUIRE_THROWS_AS(makeSyntheticScene("teapot"), UsageError);
    REQUIRE_THROWS_WITH(makeSyntheticScene("teapot"),
                        Catch::Contains("teapot") && Catch::Contains("sphere, shell, thin, glossy, fog, demo"));
}

TEST_CASE("scenes: finite values in their ranges, nothing outside the box, honest empty radii", "[synthetic]") {
    for (const std::string& name : syntheticSceneNames()) {
        INFO(name);
        const auto scene = makeSyntheticScene(name);
        const Box box = scene->bounds();
        const Box around{box.min - Vec3d::Constant(0.3), box.max + Vec3d::Constant(0.3)};
        bool in_range = true, box_holds_all = true, radii_honest = true;
        int with_density = 0;
        for (std::uint64_t i = 0; i < 20000; ++i) {
            const Vec3d p = pointIn(around, i), direction = unitVector(i);
            const double sigma = scene->density(p), empty = scene->emptyRadius(p);
            in_range &= sigma >= 0 && sigma <= scene->maxDensity() && empty >= 0 && std::isfinite(empty);
            box_holds_all &= box.contains(p) || sigma == 0;
            // Anywhere in the ball, most of all near its rim.
            radii_honest &= empty == 0 || scene->density(p + empty * (1 - 1e-9) * direction) == 0;
            if (sigma > 0) {
                const Vec3d rgb = scene->radiance(p, direction), plain = scene->diffuse(p);
                in_range &= rgb.allFinite() && rgb.minCoeff() >= 0 && rgb.maxCoeff() <= 1;
                in_range &= plain.allFinite() && plain.minCoeff() >= 0 && plain.maxCoeff() <= 1;
                ++with_density;
            }
        }
        CHECK(in_range);
        CHECK(box_holds_all);
        CHECK(radii_honest);
        CHECK(with_density > 50);
    }
}

TEST_CASE("solid scenes: distances are 1-Lipschitz and slopes are their derivatives", "[synthetic]") {
    for (const std::string& name : syntheticSceneNames()) {
        const auto scene = makeSyntheticScene(name);
        const auto* solid = dynamic_cast<const SolidScene*>(scene.get());
        if (!solid) continue;
        INFO(name);
        double steepest = 0, worst_slope = 0;
        int compared = 0;
        for (std::uint64_t i = 0; i < 20000; ++i) {
            const Vec3d p = pointIn(solid->bounds(), i), direction = unitVector(i);
            for (const double length : {1e-4, 0.05, 0.5}) {
                const double change = std::abs(solid->distance(p + length * direction) - solid->distance(p));
                steepest = std::max(steepest, change / length);
            }
            if (std::abs(solid->distance(p)) > 0.05) continue;
            // Away from ridges, where one-sided differences agree, the slope along any direction is their mean.
            constexpr double kStep = 1e-5;
            const double here = solid->distance(p);
            const double ahead = (solid->distance(p + kStep * direction) - here) / kStep;
            const double behind = (here - solid->distance(p - kStep * direction)) / kStep;
            if (std::abs(ahead - behind) > 0.01) continue;
            // Slopes by central differences reach over 0.2 edges and may see a ridge that kStep does not.
            const double error = std::abs(solid->slope(p).dot(direction) - 0.5 * (ahead + behind));
            worst_slope += error > 0.02;
            ++compared;
        }
        CHECK(steepest <= 1.0 + 1e-9);
        CHECK(compared > 100);
        CHECK(worst_slope <= 0.03 * compared);
    }
}

TEST_CASE("only the glossy scene and the demo look different from different sides", "[synthetic]") {
    for (const std::string& name : syntheticSceneNames()) {
        const auto scene = makeSyntheticScene(name);
        double largest = 0;
        for (std::uint64_t i = 0; i < 40000; ++i) {
            const Vec3d p = pointIn(scene->bounds(), i);
            if (scene->density(p) == 0) continue;
            const Vec3d a = scene->radiance(p, unitVector(2 * i)),
                        b = scene->radiance(p, unitVector(2 * i + 1));
            largest = std::max(largest, (a - b).cwiseAbs().maxCoeff());
        }
        INFO(name << ": largest difference " << largest);
        if (name == "glossy" || name == "demo")
            CHECK(largest > 0.15);
        else
            CHECK(largest == 0.0);
    }
}
