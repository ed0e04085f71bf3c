// SPDX-License-Identifier: Apache-2.0
#include "trainer/view_neighbours.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/median.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kViewsATask = 64;

/// Median over the views of the squared distance to the nearest camera that stands elsewhere; 0 if all stand in one place.
double squaredStride(const std::vector<View>& views) {
    std::vector<double> nearest(views.size(), kInfinity);
    parallelRanges(views.size(), kViewsATask, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i)
            for (const View& other : views) {
                const double apart = (other.camera.position - views[i].camera.position).squaredNorm();
                if (apart > 0) nearest[i] = std::min(nearest[i], apart);
            }
    });
    const double middle = medianOf(std::move(nearest));
    return middle < kInfinity ? middle : 0;
}

}  // namespace

std::vector<int> nearestViews(const std::vector<View>& views) {
    if (views.empty()) return {};
    constexpr double kPerTurn = 100;  // squared strides per squared radian: 6 degrees are a stride
    const double stride = squaredStride(views);
    const double per_turn = stride > 0 ? kPerTurn * stride : 1;
    std::vector<int> nearest(views.size());
    parallelRanges(views.size(), kViewsATask, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) {
            nearest[i] = static_cast<int>(i);
            double least = kInfinity;
            const Camera& here = views[i].camera;
            for (std::size_t k = 0; k < views.size(); ++k) {
                const Camera& other = views[k].camera;
                const double apart = (other.position - here.position).squaredNorm() +
                                     per_turn * (other.world_from_camera.col(2) - here.world_from_camera.col(2)).squaredNorm();
                if (k == i || !(apart < least)) continue;
                least = apart;
                nearest[i] = static_cast<int>(k);
            }
        }
    });
    return nearest;
}

}  // namespace nerfvdb
