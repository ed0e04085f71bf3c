// SPDX-License-Identifier: Apache-2.0
// Which settings nobody would refuse: those that no other setting beats in both cost and quality.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace nerfvdb {

struct CostQuality {
    double cost = 0;     // less is better
    double quality = 0;  // more is better
};

/// Numbers of the points that no other point dominates (at most the cost and at least the quality, one of them
/// strictly), by rising cost. Of equal points the first stands for all. Points that are not finite never count.
std::vector<std::size_t> paretoFront(std::span<const CostQuality> points);

}  // namespace nerfvdb
