// SPDX-License-Identifier: Apache-2.0
// Places without bounds, given by formulas: solid bodies on a ground that never ends, under a sky. Units are metres,
// z is up. What a camera sees of one is known exactly; there is no box, hence no volume or mesh of the whole.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "trainer/write_dataset.h"

namespace nerfvdb {

/// Where a ray meets something.
struct SurfaceHit {
    double t = std::numeric_limits<double>::infinity();  // along the ray; infinite: only the sky is there
    Vec3d normal = Vec3d::UnitZ();
};

/// Bodies, ground, sky and the cameras that walk there. Const access is safe from many threads.
class OpenScene {
public:
    virtual ~OpenScene() = default;

    /// Of the bodies alone, without the ground: never more than the distance to the nearest; negative inside.
    virtual double distance(const Vec3d& point) const = 0;
    /// Where a ray meets the ground, in front of t = 0.
    virtual SurfaceHit ground(const Ray& ray) const = 0;

    /// Colours that leave a surface, and that come from far away, sRGB values in [0, 1], the same from all sides.
    virtual Vec3d bodyColour(const Vec3d& point, const Vec3d& normal) const = 0;
    virtual Vec3d groundColour(const Vec3d& point, const Vec3d& normal) const = 0;
    virtual Vec3d skyColour(const Vec3d& direction) const;

    /// Where pictures are taken; no view of one split repeats a view of another.
    virtual std::vector<Camera> cameras(Split split, const SyntheticDatasetOptions& options) const = 0;
};

/// plaza, street, survey.
const std::vector<std::string>& openSceneNames();

/// `length` is the street's, in metres; only it has one. Throws UsageError: no such scene, no such length.
std::unique_ptr<OpenScene> makeOpenScene(const std::string& name, std::optional<double> length = {});

/// The first surface that a ray meets, by sphere tracing (Hart 1996) to within 2e-4 of the distance, a small part of a
/// pixel; where the ground is as near, the ground. Bodies further than 4 km are not looked for.
SurfaceHit firstHit(const OpenScene& scene, const Ray& ray);
Vec3d colourAlong(const OpenScene& scene, const Ray& ray);

/// Picture without alpha: 3 channels, sRGB values; each pixel is the mean light of four rays. Rows in parallel.
Image openImage(const OpenScene& scene, const Camera& camera);

/// As writeSyntheticDataset, with pictures without alpha.
void writeOpenDataset(const OpenScene& scene, const std::filesystem::path& folder,
                      const SyntheticDatasetOptions& options, Report& report);

}  // namespace nerfvdb
