// SPDX-License-Identifier: Apache-2.0
// A look through all photographs: along some rays of each, for what they meet.
#pragma once

#include <cstdint>
#include <functional>

#include "trainer/dataset.h"
#include "vdb/ray_tracer.h"

namespace nerfvdb {

/// Number of rays of one look, through every stride-th pixel of every stride-th row.
std::uint64_t raysOfLooks(const Dataset& dataset, int stride);

/// What the rays of a tile of one view met: samples that give a ray at least so much of its light.
using UseLook = std::function<void(const View& view, const RayTracer& tracer, const KeptSamples& kept)>;

/// Calls `use` for every tile of every view, in any order and from all threads. Pixels that do not count are left out.
void lookThrough(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy, float min_weight, int stride,
                 const UseLook& use);

}  // namespace nerfvdb
