// SPDX-License-Identifier: Apache-2.0
// Shells on their way out: other programs know boxes of one voxel size, and no nested ones (vdb/shells.h).
#pragma once

#include <cstddef>

#include "vdb/model.h"

namespace nerfvdb {

/// What the inner shells of a field become as one box in voxels of shell 0, before anything of it is made.
struct FlatSize {
    double cells = 0;
    double bytes = 0;  // of the field in memory, about
};

/// Throws UsageError unless the field has so many shells, and at least one.
FlatSize flatSize(const VoxelField& field, int shells);

/// The inner shells as one box in voxels of shell 0; what lies further out is left away, and the sky with it. Cells of
/// shell k become 8^k. Values are those that the field has at the new voxels: raw density less k ln 2, because a voxel
/// of shell k is 2^k longer. Where a shell is halved (vdb/shells.h) into voxels smaller than the box's, these hold the mean
/// of their sigma, and of features by sigma. Where two shells meet, voxels are in both and hold the finer one's values: the field is
/// continuous there, and a body that goes through has one surface and no wall inside.
/// A field of one shell stays as it is, sky apart.
/// Throws UsageError for shells that are none, or if the box would take more than `max_bytes`.
Model flatModel(const Model& model, int shells, double max_bytes = 6e9);

/// One shell alone as a box in its own voxels (those halved as above), hollow where the next smaller one lies; without the sky.
/// Throws UsageError if there is no such shell.
Model shellModel(const Model& model, int shell);

}  // namespace nerfvdb
