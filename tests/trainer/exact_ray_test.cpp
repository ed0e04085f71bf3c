// SPDX-License-Identifier: Apache-2.0
#include "trainer/exact_ray.h"

#include <numbers>

#include "core/parallel.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using test::GaussianField;
using test::SlabField;

namespace {

constexpr double kDistance = 4.03, kFieldOfView = 0.69;

Camera cameraAt(double azimuth, double elevation, int size) {
    const Vec3d eye(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                    std::sin(elevation));
    return lookAt(kDistance * eye, Vec3d::Zero(), Vec3d::UnitZ(), kFieldOfView, size, size);
}

/// What another scene looks like when all that it holds shines white.
struct WhiteScene : SyntheticScene {
    explicit WhiteScene(const SyntheticScene& scene) : shape(scene) {}
    Box bounds() const override { return shape.bounds(); }
    double density(const Vec3d& p) const override { return shape.density(p); }
    double maxDensity() const override { return shape.maxDensity(); }
    Vec3d radiance(const Vec3d&, const Vec3d&) const override { return Vec3d::Ones(); }
    Vec3d diffuse(const Vec3d&) const override { return Vec3d::Ones(); }
    double emptyRadius(const Vec3d& p) const override { return shape.emptyRadius(p); }
    double featureLength() const override { return shape.featureLength(); }
    const SyntheticScene& shape;
};

/// The plain sum over short steps: C = sum T_i (1 - exp(-sigma_i dt)) c_i at the middle of each.
RayColour midpointRule(const SyntheticScene& scene, const Ray& ray, double dt) {
    RayColour light;
    double transmittance = 1;
    for (double t = 0.5 * dt; t < 8 && transmittance > 1e-6; t += dt) {
        const Vec3d p = ray.origin + t * ray.direction;
        const double sigma = scene.density(p);
        if (sigma == 0) continue;
        light.rgb += transmittance * -std::expm1(-sigma * dt) * scene.radiance(p, ray.direction);
        transmittance *= std::exp(-sigma * dt);
    }
    light.opacity = 1 - transmittance;
    return light;
}

double difference(const RayColour& a, const RayColour& b) {
    return std::max((a.rgb - b.rgb).cwiseAbs().maxCoeff(), std::abs(a.opacity - b.opacity));
}

}  // namespace

TEST_CASE("a slab of constant density and a colour ramp: the closed form", "[exact_ray]") {
    for (const double sigma : {1e-3, 0.5, 4.0, 100.0}) {
        INFO("sigma " << sigma);
        const SlabField slab(sigma);
        const RayColour light = exactRay(slab, {{-3, 0.2, 0.1}, Vec3d::UnitX()});
        // A constant density is integrated exactly; a ray may stop at T = 1e-4.
        CHECK(std::abs(light.opacity - slab.opacity()) < 1.1e-4);
        CHECK(light.rgb[2] == Approx(0.5 * light.opacity).epsilon(1e-12));
        // The light behind T = 1e-4, and the panels' errors, which by their estimate are below 5e-5 each.
        CHECK(std::abs(light.rgb[0] - slab.risingColour()) < 2e-4);
        CHECK(std::abs(light.rgb[1] - (slab.opacity() - slab.risingColour())) < 2e-4);
        // Backwards the ramp falls; a ray that starts inside sees only what lies ahead; one that misses sees
        // nothing.
        CHECK(std::abs(exactRay(slab, {{3, 0, 0}, -Vec3d::UnitX()}).rgb[1] - slab.risingColour()) < 2e-4);
        CHECK(std::abs(exactRay(slab, {{0, 0, 0}, Vec3d::UnitX()}).opacity + std::expm1(-sigma)) < 1.1e-4);
        CHECK(exactRay(slab, {{-3, 1.01, 0}, Vec3d::UnitX()}).opacity == 0.0);
        CHECK(exactRay(slab, {{-3, 0, 0}, -Vec3d::UnitX()}).opacity == 0.0);
    }
}

TEST_CASE("a Gaussian blob: the closed form at any distance, whole and cut in half", "[exact_ray]") {
    for (const double amplitude : {0.2, 3.0, 200.0}) {
        const GaussianField blob(amplitude, 0.15);
        for (const double distance : {0.0, 0.1, 0.3, 0.5}) {
            INFO("amplitude " << amplitude << ", distance " << distance);
            const Vec3d direction = Vec3d(1, 2, -2) / 3, aside = distance * Vec3d(0, 1, 1).normalized();
            const RayColour whole = exactRay(blob, {aside - 3 * direction, direction});
            // 16 panels of at most 5e-5 each are 8e-4; their errors differ in sign and are overestimated.
            CHECK(std::abs(whole.opacity - blob.opacity(distance)) < 2e-4);
            CHECK(whole.rgb[0] == Approx(0.7 * whole.opacity).margin(1e-12));
            const RayColour half = exactRay(blob, {aside, direction});
            CHECK(std::abs(half.opacity - blob.opacityFromCentre(distance)) < 2e-4);
        }
    }
}

TEST_CASE("weights and transmittance sum to one in every scene", "[exact_ray]") {
    for (const std::string& name : syntheticSceneNames()) {
        INFO(name);
        const auto scene = makeSyntheticScene(name);
        const WhiteScene white(*scene);
        const Camera camera = cameraAt(0.7, 0.4, 24);
        double worst = 0;
        for (int i = 0; i < 24 * 24; ++i) {
            const RayColour light = exactRay(white, cameraRay(camera, i % 24 + 0.5, i / 24 + 0.5));
            worst = std::max(worst, (light.rgb - Vec3d::Constant(light.opacity)).cwiseAbs().maxCoeff());
        }
        CHECK(worst < 1e-12);  // rounding of a few hundred additions
    }
}

TEST_CASE(
    "the error bound holds: half the panels and a hundredth of the tolerance, or the plain sum, change less",
    "[exact_ray]") {
    ExactRayOptions finer;
    finer.panel_scale = 0.5;
    finer.tolerance = 5e-7;
    finer.stop_transmittance = 1e-7;
    constexpr int kSize = 48;
    for (const std::string& name : syntheticSceneNames()) {
        const auto scene = makeSyntheticScene(name);
        for (const double elevation : {-0.1, 0.5, 1.3}) {
            INFO(name << " at elevation " << elevation);
            const Camera camera = cameraAt(2.0 + elevation, elevation, kSize);
            std::vector<double> change(kSize * kSize), plain(kSize * kSize);
            parallelFor(kSize * kSize, [&](std::size_t i) {
                const Ray ray = cameraRay(camera, i % kSize + 0.5, i / kSize + 0.5);
                const RayColour light = exactRay(*scene, ray);
                change[i] = difference(light, exactRay(*scene, ray, finer));
                if (i % 23 == 0) plain[i] = difference(light, midpointRule(*scene, ray, 5e-4));
            });
            CHECK(*std::max_element(change.begin(), change.end()) < 1e-3);
            // The plain sum errs itself: where colour jumps inside a body, by up to sigma dt = 0.15 of the
            // jump.
            CHECK(*std::max_element(plain.begin(), plain.end()) < 5e-3);
        }
    }
}

TEST_CASE("every scene shows something, and something else beside it", "[exact_ray]") {
    for (const std::string& name : syntheticSceneNames()) {
        const auto scene = makeSyntheticScene(name);
        for (const double elevation : {-0.1, 0.3, 1.0}) {
            const Image image = exactImage(*scene, cameraAt(0.5 + 3 * elevation, elevation, 60));
            int touched = 0;
            bool in_range = true;
            for (int i = 0; i < 60 * 60; ++i) {
                touched += image.pixels[4 * i + 3] > 0;
                for (int c = 0; c < 4; ++c)
                    in_range &=
                        image.pixels[4 * i + c] >= 0.0f && image.pixels[4 * i + c] <= 1.0f;  // false for NaN
            }
            INFO(name << " at elevation " << elevation << ": " << touched << " of 3600 pixels");
            CHECK(in_range);
            CHECK(touched > 0.05 * 3600);
            CHECK(touched < 0.95 * 3600);
        }
    }
}

TEST_CASE("the ball's outline has the ball's size", "[exact_ray]") {
    const Camera camera = cameraAt(1.0, 0.3, 200);
    const Image image = exactImage(*makeSyntheticScene("sphere"), camera);
    int inside = 0;
    for (int i = 0; i < 200 * 200; ++i) inside += image.pixels[4 * i + 3] > 0.5f;
    const double radius_px = std::sqrt(inside / std::numbers::pi);
    const auto outline = [&](double radius) { return camera.fx * std::tan(std::asin(radius / kDistance)); };
    // A ray at the surface's own radius, 0.8, runs far enough through the edge, 0.02 wide, to lose more than
    // half its light; one outside the edge loses none. Counting pixels is good to a tenth of one.
    CHECK(radius_px > outline(0.80) - 0.1);
    CHECK(radius_px < outline(0.82) + 0.1);
}
