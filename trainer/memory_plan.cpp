// SPDX-License-Identifier: Apache-2.0
#include "trainer/memory_plan.h"

#include <algorithm>

#include "vdb/topology.h"

namespace nerfvdb {
namespace {

// Estimates for x86-64, on the generous side; what they lead to is measured in docs/stability.md.
constexpr std::size_t kProgram = std::size_t{130} << 20;  // code, libraries and what they hold before any data
constexpr std::size_t kThread = std::size_t{12} << 20;    // rays under way, decoding, the allocator's own
constexpr std::size_t kRay = 6 << 10;                     // of a batch: its kept samples and their gradients
constexpr std::size_t kLeafTables = 4 << 10;              // masks, neighbours, OpenVDB's trees while they are made

}  // namespace

std::size_t photographRoom(std::size_t max_memory) { return (max_memory - std::min(max_memory, kProgram)) / 2; }

MemoryPlan::MemoryPlan(std::size_t photographs, int channels, int largest_batch, int threads)
    : fixed_(kProgram + photographs + kThread * static_cast<std::size_t>(threads) +
             kRay * static_cast<std::size_t>(largest_batch)),
      channels_(channels) {}

std::size_t MemoryPlan::arrays(std::size_t leaves, int floats_a_voxel) const {
    return leaves * kLeafVoxels * static_cast<std::size_t>(floats_a_voxel) * sizeof(float);
}

std::size_t MemoryPlan::training(std::size_t leaves) const {
    // A density, its moment and one moment for all features stand beside the features.
    return fixed_ + leaves * kLeafTables + arrays(leaves, channels_ + 3);
}

std::size_t MemoryPlan::refining(std::size_t coarse, std::size_t fine) const {
    const auto standing = [&](int n_old, int n_new) { return arrays(coarse, n_old) + arrays(fine, n_new); };
    // Features go first, then density and the two moments.
    const std::size_t most = std::max({standing(channels_ + 3, channels_), standing(3, channels_ + 1),
                                       standing(2, channels_ + 2), standing(1, channels_ + 3)});
    return fixed_ + (coarse + fine) * kLeafTables + most;
}

}  // namespace nerfvdb
