// SPDX-License-Identifier: Apache-2.0
// What the operating system knows about this process.
#pragma once

#include <cstdint>

namespace nerfvdb {

/// Wall time since the process was started, loading of shared libraries included.
double secondsSinceProcessStart();

/// From now on large arrays that are freed go back to the system, whatever was freed before: C's library would keep what it
/// thinks will be asked for again, and one training after another would take up to a third more than each. Call it first.
void giveBackFreedMemory();

/// Largest resident memory so far, bytes.
std::uint64_t peakMemoryBytes();

}  // namespace nerfvdb
