// SPDX-License-Identifier: Apache-2.0
#include "trainer/open_scene.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "trainer/plaza_scene.h"
#include "trainer/signed_distance.h"
#include "trainer/solid_scene.h"
#include "trainer/street_scene.h"
#include "trainer/survey_scene.h"

namespace nerfvdb {
namespace {

constexpr double kFarthest = 4000;    // metres
constexpr double kNear = 2e-4;        // of the distance: so near to a surface a ray has met it
constexpr double kAtLeast = 1e-4;     // metres
constexpr int kMostSteps = 2000;      // a ray that still creeps along a wall is on it

Vec3d bodyNormal(const OpenScene& scene, const Vec3d& point, double step) {
    Vec3d slope;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3d along = step * Vec3d::Unit(axis);
        slope[axis] = scene.distance(point + along) - scene.distance(point - along);
    }
    const double length = slope.norm();
    return length > 0.0 ? Vec3d(slope / length) : Vec3d::UnitZ();
}

/// firstHit, and whether it is a body's.
std::pair<SurfaceHit, bool> findHit(const OpenScene& scene, const Ray& ray) {
    const SurfaceHit ground = scene.ground(ray);
    const double end = std::min(ground.t, kFarthest);
    double t = 0;
    for (int step = 0; t < end; ++step) {
        const Vec3d point = ray.origin + t * ray.direction;
        const double distance = scene.distance(point), near = kAtLeast + kNear * t;
        if (distance < near || step == kMostSteps) return {{t, bodyNormal(scene, point, near)}, true};
        t += distance;
    }
    return {ground, false};
}

}  // namespace

Vec3d OpenScene::skyColour(const Vec3d& direction) const {
    const double up = std::clamp(direction.z(), -0.2, 1.0), high = std::sqrt(std::max(up, 0.0));
    const Vec3d horizon(0.80, 0.83, 0.86), zenith(0.22, 0.42, 0.74), haze(0.55, 0.55, 0.52);
    Vec3d colour = up < 0 ? Vec3d(horizon + (haze - horizon) * (-up / 0.2)) : Vec3d(horizon + (zenith - horizon) * high);
    // Clouds: soft bands that follow the direction alone, thinner towards the horizon.
    const double wave = std::sin(5.0 * direction.x() + 2.0 * std::sin(3.0 * direction.y())) *
                        std::cos(4.0 * direction.y() - 1.5 * direction.x());
    const double cloud = 0.6 * smoothStep(wave) * smoothStep(2.0 * up);
    colour += cloud * (Vec3d(0.94, 0.94, 0.93) - colour);
    const double sun = std::pow(std::max(direction.dot(sunDirection()), 0.0), 200.0);
    return colour + sun * (Vec3d(1.0, 0.97, 0.88) - colour);
}

const std::vector<std::string>& openSceneNames() {
    static const std::vector<std::string> names = {"plaza", "street", "survey"};
    return names;
}

std::unique_ptr<OpenScene> makeOpenScene(const std::string& name, std::optional<double> length) {
    if (name == "street") return makeStreetScene(length.value_or(kDefaultStreet));
    if (length) throw UsageError("--length", "the scene '" + name + "'", "'street', which alone has a length");
    if (name == "plaza") return makePlazaScene();
    if (name == "survey") return makeSurveyScene();
    throw UsageError("open scene", "'" + name + "'", "one of plaza, street, survey");
}

SurfaceHit firstHit(const OpenScene& scene, const Ray& ray) { return findHit(scene, ray).first; }

Vec3d colourAlong(const OpenScene& scene, const Ray& ray) {
    const auto [hit, is_body] = findHit(scene, ray);
    if (!std::isfinite(hit.t)) return scene.skyColour(ray.direction);
    const Vec3d point = ray.origin + hit.t * ray.direction;
    return is_body ? scene.bodyColour(point, hit.normal) : scene.groundColour(point, hit.normal);
}

Image openImage(const OpenScene& scene, const Camera& camera) {
    constexpr int kSide = 2;  // rays along a pixel's sides
    Image image(camera.width, camera.height, 3);
    parallelFor(static_cast<std::size_t>(camera.height), [&](std::size_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < camera.width; ++x) {
            Vec3f light = Vec3f::Zero();
            for (int i = 0; i < kSide * kSide; ++i) {
                const double px = x + (i % kSide + 0.5) / kSide, py = y + (i / kSide + 0.5) / kSide;
                const Vec3d colour = colourAlong(scene, cameraRay(camera, px, py));
                for (int c = 0; c < 3; ++c) light[c] += linearFromSrgb(static_cast<float>(colour[c]));
            }
            for (int c = 0; c < 3; ++c) image.at(x, y)[c] = srgbFromLinear(light[c] / (kSide * kSide));
        }
    });
    return image;
}

void writeOpenDataset(const OpenScene& scene, const std::filesystem::path& folder,
                      const SyntheticDatasetOptions& options, Report& report) {
    writePictures(
        folder, options, [&](Split split) { return scene.cameras(split, options); },
        [&](const Camera& camera) { return openImage(scene, camera); }, report);
}

}  // namespace nerfvdb
