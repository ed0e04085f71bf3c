// SPDX-License-Identifier: Apache-2.0
// Fields whose integral along a ray is known in closed form.
#pragma once

#include <cmath>
#include <numbers>

#include "trainer/synthetic_scene.h"

namespace nerfvdb::test {

/// Constant density in the box [-1, 1]^3; colour rises from 0 to 1 with x, in one channel each way, 0.5 in the
/// third.
struct SlabField : SyntheticScene {
    explicit SlabField(double density_of_slab) : sigma(density_of_slab) {}
    Box bounds() const override { return {Vec3d::Constant(-1), Vec3d::Constant(1)}; }
    double density(const Vec3d& p) const override { return bounds().contains(p) ? sigma : 0.0; }
    double maxDensity() const override { return sigma; }
    Vec3d radiance(const Vec3d& p, const Vec3d&) const override { return diffuse(p); }
    Vec3d diffuse(const Vec3d& p) const override { return {0.5 * (p.x() + 1), 0.5 * (1 - p.x()), 0.5}; }
    double emptyRadius(const Vec3d&) const override { return 0.0; }
    double featureLength() const override { return 0.1; }

    /// Along +x through the whole slab, whose length is 2: integral of sigma exp(-sigma t) (t / 2) dt.
    double risingColour() const {
        const double tau = 2.0 * sigma;
        return (-std::expm1(-tau) - tau * std::exp(-tau)) / tau;
    }
    double opacity() const { return -std::expm1(-2.0 * sigma); }

    double sigma;
};

/// amplitude * exp(-|p|^2 / (2 width^2)), cut off outside a box of eight widths; grey.
struct GaussianField : SyntheticScene {
    GaussianField(double peak, double standard_deviation) : amplitude(peak), width(standard_deviation) {}
    Box bounds() const override { return {Vec3d::Constant(-8 * width), Vec3d::Constant(8 * width)}; }
    double density(const Vec3d& p) const override {
        return bounds().contains(p) ? amplitude * std::exp(-0.5 * p.squaredNorm() / (width * width)) : 0.0;
    }
    double maxDensity() const override { return amplitude; }
    Vec3d radiance(const Vec3d& p, const Vec3d&) const override { return diffuse(p); }
    Vec3d diffuse(const Vec3d&) const override { return Vec3d::Constant(0.7); }
    double emptyRadius(const Vec3d&) const override { return 0.0; }
    double featureLength() const override { return width; }

    /// Opacity of an endless line that passes the centre at `distance`.
    double opacity(double distance) const {
        return -std::expm1(-amplitude * width * std::sqrt(2 * std::numbers::pi) *
                           std::exp(-0.5 * distance * distance / (width * width)));
    }
    /// Opacity of a ray that starts level with the centre: half the line.
    double opacityFromCentre(double distance) const { return 1.0 - std::sqrt(1.0 - opacity(distance)); }

    double amplitude, width;
};

}  // namespace nerfvdb::test
