// SPDX-License-Identifier: Apache-2.0
// Which voxels exist. An OpenVDB mask tree says it; the flat tables made from the tree are what the hot path
// reads. What voxels hold is elsewhere (voxel_field.h).
//
// Words: values sit at voxel corners, that is at integer index coordinates ijk (as OpenVDB's own BoxSampler
// reads them). A *cell* ijk is the cube between ijk and ijk + (1,1,1); a point lies in cell floor(point).
// A *leaf* is a block of 8^3 voxels; its *brick* is the run of 512 values that a pool holds for it, in
// OpenVDB's order: offset = x * 64 + y * 8 + z. Leaves are numbered in the tree's own order.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"
#include "vdb/leaf_table.h"

namespace nerfvdb {

inline constexpr int kLeafDim = 8;        // voxels along a leaf's edge
inline constexpr int kLeafVoxels = 512;   // voxels in a leaf
inline constexpr int kLeafWords = 8;      // 64-bit words in a leaf's bit mask; word x holds bits y * 8 + z
using LeafMask = std::array<std::uint64_t, kLeafWords>;

/// Offset of a voxel in its brick, from coordinates inside the leaf (each 0..7).
constexpr int brickOffset(int x, int y, int z) { return x * 64 + y * 8 + z; }
inline bool testBit(const LeafMask& mask, int offset) { return mask[offset >> 6] >> (offset & 63) & 1; }
inline void setBit(LeafMask& mask, int offset) { mask[offset >> 6] |= std::uint64_t{1} << (offset & 63); }
/// The same while other threads set bits of the mask.
inline void setBitShared(LeafMask& mask, int offset) {
    std::atomic_ref word(mask[static_cast<std::size_t>(offset >> 6)]);
    const std::uint64_t bit = std::uint64_t{1} << (offset & 63);
    if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
}
/// Calls visit(offset) for every bit that is set, in order.
template <typename Visit>
void forEachBit(const LeafMask& mask, const Visit& visit) {
    for (int word = 0; word < kLeafWords; ++word)
        for (std::uint64_t bits = mask[word]; bits; bits &= bits - 1) visit(word * 64 + std::countr_zero(bits));
}

/// Leaves that contain at least one cell, and the leaves that hold these cells' upper corners.
/// Immutable: adaptation makes a new one. Threads: const access is safe.
class Topology {
public:
    /// One set of cells per leaf: leaf coordinate (voxel coordinate / 8) and the bits of its cells.
    struct LeafCells {
        Vec3i leaf;
        LeafMask cells;
    };

    Topology() = default;

    /// Builds from the cells that may hold something. All cells lie in [0, dims - 1) per axis;
    /// `dims` (voxels per axis) is a multiple of 8. Leaves given twice are united; the order does not matter.
    Topology(const Vec3i& dims, std::span<const LeafCells> cells);

    std::size_t leafCount() const { return leaf_coords_.size(); }
    /// Voxels per axis of the whole box, multiples of 8; voxel coordinates lie in [0, dims).
    const Vec3i& dims() const { return dims_; }
    /// Leaf coordinate (origin / 8) of each leaf.
    std::span<const Vec3i> leafCoords() const { return leaf_coords_; }
    /// Leaf number at a leaf coordinate, or -1. Safe for any coordinate.
    int findLeaf(const Vec3i& leaf) const;

    /// [leaf] bits of the cells that exist.
    std::span<const LeafMask> cells() const { return cells_; }
    /// [leaf] bits of the voxels that are a corner of a cell that exists ("active" in OpenVDB's sense).
    std::span<const LeafMask> voxels() const { return voxels_; }
    /// [leaf][8] numbers of the leaves at offset (b >> 2 & 1, b >> 1 & 1, b & 1); absent ones repeat the leaf
    /// itself: no cell that exists has a corner there, so such a value is never read with a weight.
    std::span<const std::int32_t> upperNeighbours() const { return upper_neighbours_; }

    std::size_t cellCount() const;   // set bits of cells()
    std::size_t voxelCount() const;  // set bits of voxels()
    std::size_t bytes() const;

private:
    Vec3i dims_ = Vec3i::Zero();
    LeafTable table_;  // leaf number, or -1
    std::vector<Vec3i> leaf_coords_;
    std::vector<LeafMask> cells_;
    std::vector<LeafMask> voxels_;
    std::vector<std::int32_t> upper_neighbours_;
};

}  // namespace nerfvdb
