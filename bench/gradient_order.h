// SPDX-License-Identifier: Apache-2.0
// What it costs that sums of gradients do not depend on the number of threads.
#pragma once

#include "bench/repeat.h"
#include "trainer/dataset.h"
#include "vdb/model.h"

namespace nerfvdb {

/// From samples with gradients to voxels that have moved, one thread.
struct GradientOrder {
    /// As training does it: samples are binned by leaf, and each leaf is summed in the order of the rays.
    Timing by_leaf;
    /// As samples come, into a pool of gradients as large as the field: nothing is sorted and nothing is locked, so
    /// several threads could only be slower per sample, and their sums would depend on who comes first.
    Timing as_they_come;
};

/// Times both, in turn, on the samples of `batch` training rays. Throws Interrupted when the report is cancelled.
GradientOrder timeGradientOrder(const Model& model, const Dataset& dataset, int batch, int repeats, Report& report);

}  // namespace nerfvdb
