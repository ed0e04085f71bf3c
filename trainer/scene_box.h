// SPDX-License-Identifier: Apache-2.0
// Where the scene is, and which of its cells could hold something at all, from cameras and alpha masks alone.
#pragma once

#include <optional>
#include <vector>

#include "trainer/dataset.h"
#include "vdb/topology.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// A grid over a box: the frame, and voxels per axis (multiples of 8). The longest side has `resolution` voxels.
struct BoxGrid {
    GridFrame frame;
    Vec3i dims;
    Shells shells;
};
BoxGrid gridOver(const Box& box, int resolution);
/// The same by the edge of a voxel, world units.
BoxGrid gridOfVoxels(const Box& box, double voxel_size);
/// A grid in `shells` shells around the box, shell 0 of the given voxels; sides are rounded up to 8 cells.
BoxGrid gridAround(const Box& box, double voxel_size, int shells);

/// Cells of a grid that no photograph rules out: those that at least `min_views` cameras see whole and, where photos
/// have alpha, that no mask shows to be empty (the visual hull; Laurentini 1994). A cell stands for its bounding
/// sphere; a view that sees only a part of it neither counts nor rules it out. In shells, whose far cells are large,
/// a cell is seen whose centre is, and nothing is born within a hundredth of the inner box's side of a camera.
std::vector<Topology::LeafCells> possibleCells(const Dataset& dataset, const BoxGrid& grid, std::size_t min_views);

/// The scene's box: given, else the data set's aabb_scale, else the bounds of the visual hull where photos have
/// alpha, else the cameras' common view. Throws DataError when nothing is left.
Box findSceneBox(const Dataset& dataset, const std::optional<Box>& given);

/// An inner box and the number of shells around it for photographs without bounds. Cameras that look at something in
/// their middle have a box around it; others, who walk about, one around themselves; `given` goes before both. Shells
/// reach to where nothing moves by more than a few pixels from one end of the capture to the other.
struct SceneShells {
    Box inner;
    int count = 1;
};
SceneShells findSceneShells(const Dataset& dataset, const std::optional<Box>& given);

/// The point nearest to all the cameras' optical axes (least squares); the mean of the positions when the axes
/// are parallel.
Vec3d commonFocus(const Dataset& dataset);

}  // namespace nerfvdb
