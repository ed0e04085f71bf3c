// SPDX-License-Identifier: Apache-2.0
// Where photographs resolve more than voxels hold: where their pixels, at what they see, are smaller. So it is near cameras
// that walk about in a scene whose shells must be wide enough for all of their way.
#pragma once

#include <memory>

#include "trainer/dataset.h"
#include "vdb/occupancy.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// The field's regions, those halved once more whose voxels will be four times as wide as what photographs resolve (a pixel, or
/// more where they are not sharp: photo_sharpness.h), or wider, when they are 1 / `shrink` as large as now: in the mean of logarithms over the light that rays of photographs take there, samples that
/// give a ray less than `min_seen` of it aside. Null if that is none, or the field has no shells. Looks along some hundred
/// thousand rays; the same for any number of threads.
std::shared_ptr<const Regions> resolvedRegions(const Dataset& dataset, const VoxelField& field, const Occupancy& occupancy,
                                               float min_seen, double shrink);

}  // namespace nerfvdb
