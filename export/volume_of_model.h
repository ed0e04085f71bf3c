// SPDX-License-Identifier: Apache-2.0
// The density of a model as a plain volume, on the model's own voxels, on coarser or on finer ones.
#pragma once

#include "vdb/volume.h"

namespace nerfvdb {

struct VolumeGridOptions {
    double voxel_scale = 1;      // edge of the volume's voxels, voxels of the field: at least 1, or 1/2, 1/3, 1/4
    double min_alpha = 1e-3;     // voxels that stop less light than this over one voxel are left out
};

/// Extinction at voxels, capped where one voxel is opaque (volumeSigma); no colours.
/// On finer voxels each gets what the field says there: between two, sigma then follows its logarithm more closely, and
/// what is thinner than a voxel of the field keeps its shape.
/// On coarser voxels each gets the mean around it, weighted as its own trilinear interpolation will read it, so that
/// the optical depth of what is smaller than a voxel stays. Throws UsageError (voxel_scale, min_alpha).
Volume volumeOfModel(const VoxelField& field, const VolumeGridOptions& options);

}  // namespace nerfvdb
