// SPDX-License-Identifier: Apache-2.0
#include "trainer/survey_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "trainer/house_row.h"
#include "trainer/street_scene.h"

namespace nerfvdb {
namespace {

constexpr double kLength = 100, kAltitude = 40, kHalfWidth = 24;  // metres; of the street, and of what is flown over
constexpr int kRows = 5;
constexpr double kFieldOfView = 45.0 * std::numbers::pi / 180.0;  // vertical or horizontal, the smaller
constexpr double kWind = 0.06;                                    // radians off the vertical, at most

class SurveyScene final : public OpenScene {
public:
    double distance(const Vec3d& p) const override { return street_->distance(p); }
    SurfaceHit ground(const Ray& ray) const override { return street_->ground(ray); }
    Vec3d bodyColour(const Vec3d& p, const Vec3d& normal) const override { return street_->bodyColour(p, normal); }
    Vec3d groundColour(const Vec3d& p, const Vec3d& normal) const override { return street_->groundColour(p, normal); }

    std::vector<Camera> cameras(Split split, const SyntheticDatasetOptions& options) const override {
        const int n = viewCount(split, options), rows = std::min(kRows, n);
        const double phase = split == Split::train ? 0.5 : split == Split::test ? 0.2 : 0.8;
        const double aspect = static_cast<double>(options.height) / options.width;
        const double fov_y = 2 * std::atan(std::tan(kFieldOfView / 2) * std::max(aspect, 1.0));
        std::vector<Camera> cameras;
        for (int row = 0; row < rows; ++row) {
            const int begin = n * row / rows, end = n * (row + 1) / rows;
            const double y = kHalfWidth * (2 * (row + phase) / rows - 1);
            for (int i = begin; i < end; ++i) {
                const double share = (i - begin + phase) / (end - begin), x = kLength * (row % 2 ? 1 - share : share);
                const auto gust = [&](std::int64_t axis) {
                    return 2 * hashedUnit(options.seed, 2 * i + axis, static_cast<std::int64_t>(split)) - 1;
                };
                const Vec3d eye(x, y + gust(0), kAltitude + gust(1));
                const Vec3d down(kWind * gust(1), kWind * gust(0), -1);
                cameras.push_back(lookAt(eye, eye + down, Vec3d::UnitY(), fov_y, options.width, options.height));
            }
        }
        return cameras;
    }

private:
    std::unique_ptr<OpenScene> street_ = makeStreetScene(kLength);
};

}  // namespace

std::unique_ptr<OpenScene> makeSurveyScene() { return std::make_unique<SurveyScene>(); }

}  // namespace nerfvdb
