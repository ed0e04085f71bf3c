// SPDX-License-Identifier: Apache-2.0
// Where a scene with bounds is.
#pragma once

#include <optional>

#include "trainer/dataset.h"

namespace nerfvdb {

/// The scene's box: given, else the data set's aabb_scale, else the bounds of the visual hull where photos have
/// alpha, else the cameras' common view. Throws DataError when nothing is left.
Box findSceneBox(const Dataset& dataset, const std::optional<Box>& given);

/// The point nearest to all the cameras' optical axes (least squares); the mean of the positions when the axes
/// are parallel.
Vec3d commonFocus(const Dataset& dataset);

}  // namespace nerfvdb
