// SPDX-License-Identifier: Apache-2.0
// Where a scene without bounds has its finest voxels, and how far it goes.
#pragma once

#include <optional>

#include "trainer/dataset.h"

namespace nerfvdb {

/// An inner box and the number of shells around it (vdb/voxel_field.h), each of twice the last one's voxels.
struct SceneShells {
    Box inner;
    int count = 1;
};

/// For photographs without bounds. `given` goes before all else. Cameras of which most have the point nearest to all
/// their axes in the middle of their pictures have a box around it. Of others, sparse points tell where voxels are needed as fine as the inner box's (boxOfPoints).
/// Without points, cameras that all look one way, as a survey's do, have a box from themselves to where they look
/// (distanceAhead); others, who walk about, one around themselves. Shells reach to where nothing moves by more than a
/// few pixels from one end of the capture to the other. Throws DataError when there is no such box, UsageError for a
/// given one that is none.
SceneShells findSceneShells(const Dataset& dataset, const std::optional<Box>& given);

/// Of boxes around the sparse points nearest to cameras that see them, the one whose voxels, and those of the shells
/// around it, are least too large for the pixels that show the points; of equals the largest. None: too few points.
std::optional<Box> boxOfPoints(const Dataset& dataset);

/// How far from cameras that look along `axis` most of what they see is, told by nothing but their places: photographs
/// of a survey overlap such that each point is in about ten, or in four of a single strip.
double distanceAhead(const Dataset& dataset, const Vec3d& axis);

}  // namespace nerfvdb
