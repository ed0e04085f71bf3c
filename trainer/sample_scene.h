// SPDX-License-Identifier: Apache-2.0
// A synthetic scene as a voxel model, so that what exports trained models exports the truth too.
#pragma once

#include "trainer/synthetic_scene.h"
#include "vdb/model.h"

namespace nerfvdb {

/// Density and diffuse colour of the scene at voxel corners, `resolution` voxels along the longest side of its
/// box.
///
/// raw = log(sigma / density_scale), density_scale = scene.maxDensity(), never below kEmptyRaw; the first three
/// of four feature channels are logit(diffuse) and the decoder's network is all zero, so that the model's
/// colour is exactly the diffuse colour, seen from everywhere. Cells exist where a corner's sigma exceeds 1e-6
/// of the largest: nothing is stored for empty space, but parts thinner than a voxel may fall between corners.
/// Threads: leaves in parallel; the result does not depend on their number. Throws UsageError for a resolution
/// outside [8, 2048].
Model sampleScene(const SyntheticScene& scene, int resolution);

}  // namespace nerfvdb
