// SPDX-License-Identifier: Apache-2.0
// Where a scene with bounds is.
#pragma once

#include <optional>

#include "trainer/dataset.h"
#include "vdb/topology.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// The scene's box: given, else the data set's aabb_scale, else the bounds of the visual hull where photos have
/// alpha, else a cube out to the farthest camera. Throws DataError when nothing is left.
Box findSceneBox(const Dataset& dataset, const std::optional<Box>& given);

/// Bounds of what at least half of the cameras see whole: where an object is that they were all turned to. A cube out to the
/// farthest of them where they share no view.
Box findCommonView(const Dataset& dataset);

/// Bounds of the cells that exist, world units, with one cell of margin.
Box boundsOfCells(const GridFrame& frame, const Topology& topology);

/// The point nearest to all the cameras' optical axes (least squares); the mean of the positions when the axes
/// are parallel.
Vec3d commonFocus(const Dataset& dataset);

/// Where the cameras of all views, at least one, stand.
Box boxOfCameras(const Dataset& dataset);

/// Whether a sparse point is not finite, or as good as infinitely far from cameras that stand in such a box, as matches along
/// the baseline make them: farther than a million times its diagonal. At a thousand a point moves by about a pixel between them.
bool isAtInfinity(const Vec3d& point, const Box& cameras);
/// "3 of 40 points are not finite, ...": the sentence about those that were left out for it.
std::string leftOutAtInfinity(std::size_t n, std::size_t n_all);

}  // namespace nerfvdb
