// SPDX-License-Identifier: Apache-2.0
// A field as few bytes: which cells exist (exactly) and what active voxels hold (rounded to a step per channel).
// Bytes never depend on the number of threads; what was decoded encodes to the same bytes again.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "vdb/value_steps.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Cells of a topology as bytes, and back: the same cells, voxels and order of leaves.
/// `where` names the place for the DataError that wrong bytes raise.
std::string encodeTopology(const Topology& topology);
Topology decodeTopology(const Vec3i& dims, std::span<const std::uint8_t> bytes, const std::string& where);

/// Values of active voxels as bytes, and back into a field of the same topology and channels.
std::string encodeValues(const VoxelField& field, const StepExponents& steps);
void decodeValues(std::span<const std::uint8_t> bytes, const std::string& where, VoxelField& field);

}  // namespace nerfvdb
