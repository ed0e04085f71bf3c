// SPDX-License-Identifier: Apache-2.0
// What the operating system knows about this process.
#pragma once

#include <cstdint>

namespace nerfvdb {

/// Wall time since the process was started, loading of shared libraries included.
double secondsSinceProcessStart();

/// Largest resident memory so far, bytes.
std::uint64_t peakMemoryBytes();

}  // namespace nerfvdb
