// SPDX-License-Identifier: Apache-2.0
// Where an object is that stands before a plain background.
#pragma once

#include "core/report.h"
#include "trainer/dataset.h"
#include "trainer/train_options.h"

namespace nerfvdb {

/// The bounds, in a box that may be much larger, of what a short training of large voxels finds there, world units (as the
/// coarse geometry search of DirectVoxGO, Sun et al. 2022): all of the box where it finds nothing. Of `options` the seed,
/// the background and the memory are used. Throws Interrupted when the report is cancelled, and what train throws.
Box findObject(const Dataset& dataset, const Box& around, const TrainOptions& options, Report& report);

}  // namespace nerfvdb
