// SPDX-License-Identifier: Apache-2.0
// How a capture is cut into blocks, and which photographs each block learns from.
#pragma once

#include <optional>

#include "trainer/dataset.h"
#include "vdb/block_grid.h"

namespace nerfvdb {

inline constexpr std::size_t kFewestBlockViews = 3;  // a block with fewer photographs is not trained

/// The blocks of a capture: of `bounds`, or, along the axes that are cut, of where the cameras are, and else of the inner
/// box of an open scene. Up is the axis along which the cameras are least apart (of a walk in a line, the one that is
/// upright in pictures). Needs cameras only.
/// Throws UsageError (cutIntoBlocks; cameras that are not apart along an axis that is cut), DataError for no views.
BlockGrid planBlocks(const Dataset& dataset, int columns, int rows, const std::optional<Box>& bounds);

/// [block, as in grid.blocks()] number of views that it takes.
std::vector<std::size_t> viewsOfBlocks(const BlockGrid& grid, const Dataset& dataset);

}  // namespace nerfvdb
