// SPDX-License-Identifier: Apache-2.0
// Which cells of a grid could hold something at all, from cameras and alpha masks alone.
#pragma once

#include <cstddef>
#include <vector>

#include "trainer/box_grid.h"
#include "trainer/dataset.h"
#include "vdb/topology.h"

namespace nerfvdb {

/// Cells of a grid that no photograph rules out: those that at least `min_views` cameras see whole and, where photos
/// have alpha, that no mask shows to be empty (the visual hull; Laurentini 1994). A cell stands for its bounding
/// sphere; a view that sees only a part of it neither counts nor rules it out. In shells, whose far cells are large,
/// a cell is seen whose centre is, and nothing is born within a hundredth of the inner box's side of a camera.
std::vector<Topology::LeafCells> possibleCells(const Dataset& dataset, const BoxGrid& grid, std::size_t min_views);

}  // namespace nerfvdb
