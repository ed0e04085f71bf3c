// SPDX-License-Identifier: Apache-2.0
#include "bench/pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace nerfvdb {

std::vector<std::size_t> paretoFront(std::span<const CostQuality> points) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (std::isfinite(points[i].cost) && std::isfinite(points[i].quality)) order.push_back(i);
    // By cost, the better one first among equals: then a point is on the front if it is better than all before
    // it.
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return points[a].cost != points[b].cost ? points[a].cost < points[b].cost
                                                : points[a].quality > points[b].quality;
    });
    std::vector<std::size_t> front;
    double best = -std::numeric_limits<double>::infinity();
    for (const std::size_t i : order) {
        if (!(points[i].quality > best)) continue;
        best = points[i].quality;
        front.push_back(i);
    }
    return front;
}

}  // namespace nerfvdb
