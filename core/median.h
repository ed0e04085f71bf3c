// SPDX-License-Identifier: Apache-2.0
// The middle of some numbers, which a few absurd ones do not move.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace nerfvdb {

/// Of at least one number; of an even count the upper of the two in the middle.
inline double medianOf(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace nerfvdb
