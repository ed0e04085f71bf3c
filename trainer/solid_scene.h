// SPDX-License-Identifier: Apache-2.0
// Scenes of solid bodies: density follows from a signed distance through a steep but smooth edge, and colour
// from albedo, one sun and a sky.
#pragma once

#include "trainer/signed_distance.h"
#include "trainer/synthetic_scene.h"

namespace nerfvdb {

/// sigma = solid_density * S((edge - d) / (2 edge)), d the signed distance, S smoothStep: exactly zero from
/// d = edge on, solid_density / 2 on the surface, solid_density from d = -edge inwards.
class SolidScene : public SyntheticScene {
public:
    /// Negative inside, 1-Lipschitz.
    virtual double distance(const Vec3d& point) const = 0;

    Box bounds() const final { return bounds_; }
    double maxDensity() const final { return solid_density_; }
    double density(const Vec3d& point) const final {
        return solid_density_ * smoothStep((edge_ - distance(point)) / (2.0 * edge_));
    }
    double emptyRadius(const Vec3d& point) const final { return std::max(distance(point) - edge_, 0.0); }
    double featureLength() const final { return edge_; }
    double edge() const { return edge_; }

    Vec3d radiance(const Vec3d& point, const Vec3d&) const override { return diffuse(point); }

    /// Derivative of the distance, length <= 1. Here by central differences.
    virtual Vec3d slope(const Vec3d& point) const;
    /// Slope scaled to unit length; +z where it vanishes.
    Vec3d normal(const Vec3d& point) const;

protected:
    /// `bounds` must contain every point with distance < edge.
    SolidScene(const Box& bounds, double solid_density, double edge)
        : bounds_(bounds), solid_density_(solid_density), edge_(edge) {}

private:
    Box bounds_;
    double solid_density_, edge_;
};

/// Unit vector towards the sun that lights every solid scene.
inline const Vec3d& sunDirection() {
    static const Vec3d direction = Vec3d(0.48, -0.52, 0.70).normalized();
    return direction;
}

/// Lambert's law for the sun, plus a sky that is brighter above: a factor for albedo.
inline double softLight(const Vec3d& normal) {
    return 0.42 + 0.16 * normal.z() + 0.52 * std::max(normal.dot(sunDirection()), 0.0);
}

/// Blinn 1977: (n . h)^64 with h halfway between the sun and the eye; in [0, 1].
inline double sunHighlight(const Vec3d& normal, const Vec3d& direction) {
    const Vec3d halfway = (sunDirection() - direction).normalized();
    double s = std::max(normal.dot(halfway), 0.0);
    for (int i = 0; i < 6; ++i) s *= s;
    return s;
}

}  // namespace nerfvdb
