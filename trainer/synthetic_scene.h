// SPDX-License-Identifier: Apache-2.0
// Scenes given by formulas: density and radiance are known exactly at every point, so that a trained model can
// be compared with the truth itself. How a ray through one becomes a colour: exact_ray.h.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

/// Density and radiance at every point of space. Const access is safe from many threads.
class SyntheticScene {
public:
    virtual ~SyntheticScene() = default;

    /// World units; density is zero outside.
    virtual Box bounds() const = 0;

    /// sigma at a point, 1 / world unit, in [0, maxDensity()].
    virtual double density(const Vec3d& point) const = 0;
    virtual double maxDensity() const = 0;

    /// Colour that leaves a point against `direction` (unit, the way a ray looks), sRGB values in [0, 1].
    virtual Vec3d radiance(const Vec3d& point, const Vec3d& direction) const = 0;

    /// Radiance without what depends on direction.
    virtual Vec3d diffuse(const Vec3d& point) const = 0;

    /// Density is zero in the open ball of this radius about the point. 0 is always right; larger values let
    /// rays skip empty space.
    virtual double emptyRadius(const Vec3d& point) const = 0;

    /// World length over which density and radiance may change their character; the integrator starts from it.
    virtual double featureLength() const = 0;
};

/// sphere, shell, thin, glossy, fog, demo.
const std::vector<std::string>& syntheticSceneNames();

/// Throws UsageError that lists the names when there is no such scene.
std::unique_ptr<SyntheticScene> makeSyntheticScene(const std::string& name);

}  // namespace nerfvdb
