// SPDX-License-Identifier: Apache-2.0
#include "trainer/view_neighbours.h"

#include <limits>

#include "core/parallel.h"

namespace nerfvdb {

std::vector<int> nearestViews(const std::vector<View>& views) {
    const std::size_t n = views.size();
    Vec3d mean = Vec3d::Zero();
    for (const View& view : views) mean += view.camera.position / static_cast<double>(n);
    double mean_square = 0;
    for (const View& view : views) mean_square += (view.camera.position - mean).squaredNorm() / static_cast<double>(n);
    // All in one place: only directions differ.
    const double per_square = mean_square > 0 ? 1 / mean_square : 0;

    std::vector<int> nearest(n);
    parallelRanges(n, 64, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) {
            nearest[i] = static_cast<int>(i);
            double least = std::numeric_limits<double>::infinity();
            const Camera& here = views[i].camera;
            for (std::size_t k = 0; k < n; ++k) {
                const Camera& other = views[k].camera;
                const double apart = per_square * (other.position - here.position).squaredNorm() +
                                     (other.world_from_camera.col(2) - here.world_from_camera.col(2)).squaredNorm();
                if (k == i || !(apart < least)) continue;
                least = apart;
                nearest[i] = static_cast<int>(k);
            }
        }
    });
    return nearest;
}

}  // namespace nerfvdb
