// SPDX-License-Identifier: Apache-2.0
// The colour of a model at a point, of no direction.
#pragma once

#include <span>
#include <vector>

#include "vdb/model.h"

namespace nerfvdb {

/// Features are read trilinearly at points of the model's world and decoded as the mean over all directions
/// (Decoder::diffuse): rgb [point][3], sRGB values. Corners that are not active have no features and no say. Returns
/// [point] whether any active voxel was around; without, the colour is what zero features decode to.
std::vector<bool> diffuseColors(const Model& model, std::span<const Vec3d> points, std::span<float> rgb);

}  // namespace nerfvdb
