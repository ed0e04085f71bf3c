// SPDX-License-Identifier: Apache-2.0
#include "trainer/even_color.h"

#include <cstdio>
#include <vector>

#include "core/metrics.h"

namespace nerfvdb {

double evenColorError(const RaySource& source, std::uint64_t step, const Vec3f& background) {
    constexpr int kRays = 4096;
    std::vector<TrainingRay> rays(kRays);
    source.draw(step, 0, rays);
    Vec3d sum = Vec3d::Zero(), squares = Vec3d::Zero();
    for (const TrainingRay& ray : rays) {
        const double alpha = ray.rgba[3];
        const Vec3d color = alpha * Vec3d(ray.rgba[0], ray.rgba[1], ray.rgba[2]) + (1 - alpha) * background.cast<double>();
        sum += color;
        squares += color.cwiseProduct(color);
    }
    const Vec3d mean = sum / kRays;
    return (squares / kRays - mean.cwiseProduct(mean)).cwiseMax(0.0).mean();
}

std::string nothingLearned(const RaySource& source, std::int64_t steps, const Vec3f& background, double mean_error) {
    constexpr std::int64_t kLeastSteps = 500;  // before, most is fog yet
    constexpr double kVisible = 4e-3;          // of squared error, 24 dB: photographs of nearly one colour may have no more so soon
    if (steps < kLeastSteps || mean_error < kVisible) return {};
    if (mean_error < evenColorError(source, static_cast<std::uint64_t>(steps), background)) return {};
    char text[192];
    std::snprintf(text, sizeof text, "nothing was learned: training rays have %.1f dB, no more than a picture of one colour would; are "
                  "poses and --bounds those of this scene?", psnrFromMse(mean_error));
    return text;
}

}  // namespace nerfvdb
