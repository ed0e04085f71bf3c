// SPDX-License-Identifier: Apache-2.0
// Which cells hold so little that training may pass them by. One threshold per cell would erase thin fog, whose
// every voxel stops next to nothing although all of them together hide the horizon; so the threshold follows from
// what it would hide along whole rays.
#pragma once

#include <cstdint>

#include "trainer/ray_source.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// At most this share of a ray's light (the sum of its samples' weights) may hide in cells that are passed by ...
inline constexpr float kMostHidden = 0.1f;
/// ... on all but this share of the rays, ...
inline constexpr double kRaysBeyond = 0.01;
/// ... and without them this much more light may pass, in the mean of the rays that meet something. What stands in front
/// of a wall may be passed by, the wall is there; in fog nothing else stops the light. And fog that is passed by learns no
/// more, so that what is left grows sharp, and more of it is passed by: which bound ends that was measured
/// (docs/quality.md, "Fog that is passed by").
inline constexpr double kMostPassed = 0.005;

/// The largest min_alpha for findOccupied that keeps that promise, out of 0.01, three quarters of that ... 1e-5.
/// Cells of less than 1e-5 count as nothing: 500 of them in a row let half a percent pass.
/// Measured on rays that `source` draws for `step`, of which those that meet nothing are not counted: they would
/// only dilute the share. Without rays: the largest.
float chooseMinAlpha(const VoxelField& field, const RaySource& source, std::uint64_t step);

}  // namespace nerfvdb
