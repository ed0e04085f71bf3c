// SPDX-License-Identifier: Apache-2.0
#include "trainer/stray_cameras.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "core/median.h"

namespace nerfvdb {

void warnOfStrayCameras(Dataset& dataset) {
    constexpr double kFar = 100;  // of the median distance from the median place
    constexpr std::size_t kFewest = 5, kSome = 10;  // of so many views one may be astray
    std::vector<Vec3d> places;
    for (const View& view : dataset.views)
        if (view.camera.position.allFinite()) places.push_back(view.camera.position);
    if (places.size() < kFewest) return;
    Vec3d middle;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> along;
        for (const Vec3d& place : places) along.push_back(place[axis]);
        middle[axis] = medianOf(along);
    }
    std::vector<double> distances;
    for (const Vec3d& place : places) distances.push_back((place - middle).norm());
    const double usual = medianOf(distances);
    const auto isStray = [&](const View& view) { return (view.camera.position - middle).norm() > kFar * usual; };
    const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), isStray);
    const auto n = std::count_if(dataset.views.begin(), dataset.views.end(), isStray);
    // Where many are, the others stand in one point, and it is they that are odd.
    if (usual <= 0 || n == 0 || static_cast<std::size_t>(n) > std::max<std::size_t>(1, places.size() / kSome)) return;
    char times[32];
    std::snprintf(times, sizeof times, "%.0f", (first->camera.position - middle).norm() / usual);
    dataset.warnings.push_back(dataset.root.string() + ": " + std::to_string(n) + " of " + std::to_string(dataset.views.size()) +
                               " cameras stand far from all others (first: " + first->path.string() + ", " + times +
                               " times as far from the middle as most): where a pose is wrong, leave it out");
}

}  // namespace nerfvdb
