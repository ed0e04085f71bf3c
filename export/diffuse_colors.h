// SPDX-License-Identifier: Apache-2.0
// The colour of a field at a point, of no direction.
#pragma once

#include <span>
#include <vector>

#include "vdb/decoder.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Features are read trilinearly at points of the field's world and decoded as the mean over all directions
/// (Decoder::diffuse): rgb [point][3], sRGB values. Corners that are not active have no features and no say. Returns
/// [point] whether any active voxel was around; without, the colour is what zero features decode to.
std::vector<bool> diffuseColors(const Decoder& decoder, const VoxelField& field, std::span<const Vec3d> points,
                                std::span<float> rgb);

}  // namespace nerfvdb
