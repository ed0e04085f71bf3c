// SPDX-License-Identifier: Apache-2.0
// Blocks of a scene on their way out: as volumes that fade into each other, or as one density with one surface.
#pragma once

#include <vector>

#include "vdb/block_grid.h"
#include "vdb/model.h"

namespace nerfvdb {

/// The inner box of a block with density times BlockGrid::weight: where neighbours overlap, their extinctions add up to
/// those of one scene. Cells where the block has no weight are gone, and so are its shells and its sky.
/// Throws DataError for a model that is no block of the grid, or of which nothing is left.
Model fadedBlock(const BlockGrid& grid, const BlockId& block, const Model& model);

/// The density in a block's inner box, without features.
struct BlockDensity {
    BlockId block;
    VoxelField field;
};
/// Throws as fadedBlock.
BlockDensity densityOfBlock(const BlockGrid& grid, const BlockId& block, const Model& model);

/// One density out of those of the blocks, in voxels of the finest: extinction at a voxel is the blocks' sum by weight.
/// The model has no features and decodes no colours. Throws DataError if there is nothing to join.
Model joinBlocks(const BlockGrid& grid, std::vector<BlockDensity> blocks);

}  // namespace nerfvdb
