// SPDX-License-Identifier: Apache-2.0
// The part of a mesh that one block of the surface makes, at the place that the block has in the mesh.
#pragma once

#include "export/mesh.h"
#include "export/surface_blocks.h"

namespace nerfvdb {

/// Writes the block's own vertices, Block::n_edges on crossed edges and then Block::n_centres inside of cells.
void writeBlockVertices(const Surface& surface, const Block& block, Vec3f* positions, Vec3f* normals);

/// Writes the block's Block::n_triangles triangles; they name vertices of the block and of the blocks above it.
void writeBlockTriangles(const Surface& surface, const BlockList& blocks, const Block& block,
                         Triangle* triangles);

/// For the same triangles, whether they do nothing but close the surface: those in cells that the field does not have, or
/// that leave the surface's bounds.
void markClosingTriangles(const Surface& surface, const Block& block, std::uint8_t* is_closing);

}  // namespace nerfvdb
