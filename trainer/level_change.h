// SPDX-License-Identifier: Apache-2.0
// What learns, carried over to smaller voxels: where the field goes, the optimiser's memory of it goes too. Occupancy is the
// caller's to find anew.
#pragma once

#include "trainer/train_step.h"

namespace nerfvdb {

/// All voxels half as large, of the cells in `fine` (subdivide). Nothing counts as seen afterwards. One array follows the other,
/// so that old and new ones do not stand side by side.
void refineState(TrainState& state, Topology fine);

/// Voxels of regions half as large: `halved` is what halveRegions made of the field's topology and `shells`. Cells made of one
/// that was seen count as seen.
void halveState(TrainState& state, Topology halved, const Shells& shells);

}  // namespace nerfvdb
