// SPDX-License-Identifier: Apache-2.0
// Colours for the voxels of a plain volume, which has one each, from a model, whose colours change with the direction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/report.h"
#include "vdb/model.h"
#include "vdb/volume.h"

namespace nerfvdb {

/// To every voxel what the model decodes from the features there, averaged over all directions (Decoder::diffuse).
/// Where the model has no features, the mean of the voxels around.
void decodeColors(const Model& model, Volume& volume);

struct CollectOptions {
    double rays = 4e6;           // about so many, spread evenly over all pixels of all cameras
    float min_weight = 1e-3f;    // samples below this show a voxel to nobody ...
    float max_dropped = 0.01f;   // ... as long as those of a ray sum to at most this
};

/// To every voxel the mean colour of the model's rays that see it, from cameras of the model's world, weighted by how
/// much of the ray's light comes from there: diffuse, where reflections were seen from few sides. Voxels around
/// those that were seen get the mean of their neighbours, others none. Returns [leaf] the voxels that were seen, and
/// not only by a volume that is fatter than the model: far from any colour.
/// The same for any number of threads. Throws Interrupted.
std::vector<LeafMask> collectColors(const Model& model, std::span<const Camera> cameras, const CollectOptions& options,
                                    Volume& volume, Report& report);

}  // namespace nerfvdb
