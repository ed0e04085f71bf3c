// SPDX-License-Identifier: Apache-2.0
// Rays on the rack: optical depths from nothing to a wall, steps from 1e-7 to 1e4, up to 1e5 samples, scenes
// far from the origin, rays along faces and edges; each traced and judged in long double (ray_reference.h).
#pragma once

#include <cstddef>
#include <vector>

#include "bench/stress_row.h"
#include "core/report.h"

namespace nerfvdb {

struct RayStressOptions {
    bool is_long = false;   // every combination, instead of those that differ most
    std::size_t every = 1;  // judge each nth case only
};

/// Rows of area "ray": where samples lie; optical depth, opacity, colour, depth and gradients given the samples
/// (that is, of the kernels alone), of voxels too; the same of whole rays, where the places of samples err as
/// well; values that are not finite. On the instruction set in use.
std::vector<StressRow> stressRays(const RayStressOptions& options, Report& report);

}  // namespace nerfvdb
