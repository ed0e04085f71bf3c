// SPDX-License-Identifier: Apache-2.0
// What training will hold in memory, told beforehand, so that it stays within what is allowed.
#pragma once

#include <cstddef>

namespace nerfvdb {

/// Bytes of photographs that may stand in memory; more are read from a file: half of what the program leaves.
std::size_t photographRoom(std::size_t max_memory);

/// Sizes in bytes; resident memory, as the system counts it.
class MemoryPlan {
public:
    /// `photographs`: of those that stand in memory, or of as much of the files on disk as may be mapped at once.
    MemoryPlan(std::size_t photographs, int channels, int largest_batch, int threads);

    /// While a field of so many leaves is learned.
    std::size_t training(std::size_t leaves) const;
    /// While one of `coarse` leaves becomes one of `fine` leaves, array by array (Training::refine).
    std::size_t refining(std::size_t coarse, std::size_t fine) const;

private:
    std::size_t arrays(std::size_t leaves, int floats_a_voxel) const;
    std::size_t fixed_;
    int channels_;
};

}  // namespace nerfvdb
