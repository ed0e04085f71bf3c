// SPDX-License-Identifier: Apache-2.0
// How much more memory a piece of work needed than was in use when it began. Linux.
#pragma once

#include <cstdint>

namespace nerfvdb {

/// Sets the kernel's mark of the largest resident memory back to what is resident now; freed memory is given
/// back first, or it would hide what is taken anew.
class PeakMemory {
public:
    PeakMemory();
    /// Bytes that were resident at most since then, beyond those at the beginning; 0 where the kernel does not
    /// say.
    std::int64_t extraBytes() const;

private:
    std::int64_t before_ = 0;
};

}  // namespace nerfvdb
