// SPDX-License-Identifier: Apache-2.0
#include "trainer/even_color.h"

#include <vector>

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

}  // namespace nerfvdb
