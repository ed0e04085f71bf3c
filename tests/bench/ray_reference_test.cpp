// SPDX-License-Identifier: Apache-2.0
// The judge is judged: closed forms, and its derivative against differences of its own light.
#include "bench/ray_reference.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;

namespace {

struct Subject {
    VoxelField field = test::randomField(Vec3i(24, 16, 16), 4, 1.0, -3.0f, 0.0f, 5);
    Occupancy occupancy = occupancyFromCells(
        field.topology(), {field.topology().cells().begin(), field.topology().cells().end()});
    TraceScene scene{field, occupancy};
};

Ray throughTheMiddle(const VoxelField& field) {
    return {field.frame().worldFromIndex({-4, 6.3, 7.4}), Vec3d(1, 0.05, -0.1).normalized()};
}

}  // namespace

TEST_CASE("the exact march starts where the ray enters the box and ends where it leaves it") {
    const Subject subject;
    const Ray ray{subject.field.frame().worldFromIndex({-4, 6.5, 7.25}), Vec3d::UnitX()};
    const ExactMarch march(subject.scene, ray, 0.5f, 0.5f);
    REQUIRE(march.hits());
    CHECK(static_cast<double>(march.entry()) == Approx(4));
    CHECK(static_cast<double>(march.length()) == Approx(23));
    CHECK(static_cast<double>(march.position(0, 0)) == Approx(0.25));
    CHECK(static_cast<double>(march.faceDistance(0)) == Approx(0.25));
    CHECK(march.samples().size() == 46);
    CHECK_FALSE(ExactMarch(subject.scene, {ray.origin, -Vec3d::UnitX()}, 0.5f, 0.5f).hits());
    // Along the box's faces, a hair inside and outside.
    const auto inPlane = [&](double y) {
        return ExactMarch(subject.scene, {subject.field.frame().worldFromIndex({-4, y, 7}), Vec3d::UnitX()},
                          0.5f, 0.5f)
            .hits();
    };
    CHECK(inPlane(1e-6));
    CHECK_FALSE(inPlane(-1e-6));
    CHECK(inPlane(15 - 1e-6));
    CHECK_FALSE(inPlane(15 + 1e-6));
}

TEST_CASE("exact weights and what is left of the light sum to one, and the gradient is that of the light") {
    const Subject subject;
    const float step = 0.5f;
    std::vector<ExactSample> samples =
        ExactMarch(subject.scene, throughTheMiddle(subject.field), step, 0.5f).samples();
    REQUIRE(samples.size() > 30);
    const ExactLight light = exactLight(subject.scene, step, samples);
    CHECK(static_cast<double>(light.weight_sum + light.transmittance) == Approx(1).epsilon(1e-15));
    CHECK(light.weight_sum > 0.1L);

    const std::vector<float> dl_dmean = {0.7f, -0.3f, 0.2f, 0.5f};
    const float dl_dtransmittance = -0.4f, dl_ddistortion = 0.3f;
    const ExactGradient gradient =
        exactGradient(subject.scene, samples, light, dl_dmean, dl_dtransmittance, dl_ddistortion);
    const Exact reach = distortionReach(1);
    // The loss from raw densities that differ from the field's: tau scales with exp(raw).
    const auto loss = [&](std::size_t changed, Exact by) {
        Exact transmittance = 1, weight_sum = 0, distortion = 0;
        std::vector<Exact> mean(4), weights, places;
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const Exact tau = light.tau[i] * (i == changed ? std::exp(by) : 1);
            const Exact weight = transmittance * -std::expm1(-tau);
            transmittance *= std::exp(-tau);
            weight_sum += weight;
            const Exact place = samples[i].t / 23;
            weights.push_back(weight), places.push_back(place <= 1 ? place : 1 + std::log(place));
            for (std::size_t c = 0; c < 4; ++c) mean[c] += weight * light.features[4 * i + c];
        }
        for (std::size_t i = 0; i < weights.size(); ++i)
            for (std::size_t j = 0; j < weights.size(); ++j)
                distortion -= weights[i] * weights[j] * reach * std::expm1(-std::abs(places[i] - places[j]) / reach);
        Exact sum = transmittance * dl_dtransmittance + distortion * dl_ddistortion;
        for (std::size_t c = 0; c < 4; ++c) sum += mean[c] / weight_sum * dl_dmean[c];
        return sum;
    };
    const Exact h = 1e-5L;  // curvature leaves h^2, rounding 1e-19 / h
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const Exact difference = (loss(i, h) - loss(i, -h)) / (2 * h);
        CHECK(std::abs(static_cast<double>(gradient.dl_draw[i] - difference)) <= 1e-9);
        CHECK(std::abs(gradient.dl_draw[i]) <= gradient.magnitude[i]);
    }
}
