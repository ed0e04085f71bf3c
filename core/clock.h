// SPDX-License-Identifier: Apache-2.0
// Time on the wall.
#pragma once

#include <chrono>

namespace nerfvdb {

/// Seconds since it was made.
class Clock {
public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace nerfvdb
