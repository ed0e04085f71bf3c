// SPDX-License-Identifier: Apache-2.0
// Where the surface runs: the blocks that it meets, how many vertices and triangles each will have, and from
// which number on. No table of shared vertices is needed: a crossed edge belongs to the block of its lower
// voxel, and its number is its rank among the block's crossed edges.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "export/surface_cells.h"

namespace nerfvdb {

inline constexpr std::size_t kBlocksPerTask = 32;

/// Cells and edges whose lower voxel lies in one leaf's place, whether that leaf exists or not: a surface that
/// closes at the border of the known region reaches one voxel into absent leaves below.
struct Block {
    Vec3i leaf;  // leaf coordinate; -1 is possible
    // Edges that cross the surface, [axis][x], bit y * 8 + z of the lower voxel.
    std::array<LeafMask, 3> crossed{};
    std::array<std::array<std::uint16_t, 3>, kLeafDim> rank{};  // [x][axis] crossed edges of the block before
    std::uint32_t n_edges = 0, n_centres = 0, n_triangles = 0;
    std::uint32_t first_vertex = 0, first_triangle = 0;

    bool isEmpty() const { return n_edges == 0 && n_triangles == 0; }
};

/// The blocks that the surface runs through, with their places in the mesh, and how to find them.
class BlockList {
public:
    /// Throws NumericError when the mesh would have more vertices or triangles than its files can number.
    explicit BlockList(const Surface& surface);

    std::size_t size() const { return blocks_.size(); }
    const Block& operator[](std::size_t i) const { return blocks_[i]; }
    std::size_t vertexCount() const { return n_vertices_; }
    std::size_t triangleCount() const { return n_triangles_; }

    /// The block at a leaf coordinate, or null if the surface does not meet it.
    const Block* find(const Vec3i& coord) const;

private:
    void placeBlocks();

    const Topology& topology_;
    std::vector<Block> blocks_;
    std::vector<std::int32_t> number_of_leaf_;  // [leaf] in blocks_, or -1
    std::size_t first_absent_ = 0;              // in blocks_: the places without a leaf, sorted
    std::size_t n_vertices_ = 0, n_triangles_ = 0;
};

}  // namespace nerfvdb
