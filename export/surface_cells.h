// SPDX-License-Identifier: Apache-2.0
// The part of a field that marching cubes reads at a time: the cells of one leaf's place, their corners inside
// or outside, and the densities around them. Outside the active voxels the field holds kEmptyRaw.
// What fill_inside.h adds to the inside has no density that means anything: it reads as kFilledRaw.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

#include "export/marching_cubes_table.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Step from the lowest corner of a cube to the given one, numbered as in marching_cubes_table.h.
inline Vec3i cornerStep(int corner) { return {corner >> 2 & 1, corner >> 1 & 1, corner & 1}; }

/// Calls visit(number) for every set bit, in rising order.
template <typename Visit>
void forEachBit(std::uint64_t word, const Visit& visit) {
    for (; word; word &= word - 1) visit(std::countr_zero(word));
}

inline constexpr float kFilledRaw = std::numeric_limits<float>::infinity();  // above every iso, like no density

/// A set of leaf coordinates inside a box: one bit for each.
class LeafSet {
public:
    LeafSet() = default;  // empty, of an empty box
    explicit LeafSet(const Vec3i& dims_in_voxels)
        : dims_(dims_in_voxels / kLeafDim), bits_(dims_.cast<std::size_t>().prod(), false) {}

    bool contains(const Vec3i& leaf) const { return isInBox(leaf) && bits_[place(leaf)]; }
    /// True if the leaf lies in the box and was not in the set before.
    bool insert(const Vec3i& leaf) {
        if (!isInBox(leaf) || bits_[place(leaf)]) return false;
        return bits_[place(leaf)] = true;
    }

private:
    bool isInBox(const Vec3i& leaf) const {
        return (leaf.array() >= 0).all() && (leaf.array() < dims_.array()).all();
    }
    std::size_t place(const Vec3i& leaf) const {
        return (static_cast<std::size_t>(leaf.x()) * dims_.y() + leaf.y()) * dims_.z() + leaf.z();
    }

    Vec3i dims_ = Vec3i::Zero();
    std::vector<bool> bits_;
};

/// Voxel coordinates, both ends included. The default holds every voxel.
struct VoxelBox {
    Vec3i min = Vec3i::Constant(std::numeric_limits<int>::min() / 2);
    Vec3i max = Vec3i::Constant(std::numeric_limits<int>::max() / 2);

    bool contains(const Vec3i& voxel) const {
        return (voxel.array() >= min.array()).all() && (voxel.array() <= max.array()).all();
    }
    /// The voxels of a leaf's place that lie in the box.
    LeafMask maskOf(const Vec3i& leaf) const;
};

/// A field cut at a raw density, and the voxels inside.
struct Surface {
    const VoxelField& field;
    float iso;                     // raw density
    std::vector<LeafMask> inside;  // [leaf] active voxels with raw >= iso, and what was filled
    float largest_raw;             // of all active voxels; -infinity without any
    bool is_filled = false;        // `inside` holds voxels whose density means nothing
    LeafSet enclosed = {};         // places without a leaf that were filled
    VoxelBox bounds = {};          // nothing beyond is inside; values there are those of the field
};

/// Throws NumericError when the density of an active voxel is not finite or beyond 1e15.
Surface cutField(const VoxelField& field, float iso);

/// Takes away from the inside what lies beyond `bounds`: the surface closes there.
void clipSurface(Surface& surface, const VoxelBox& bounds);

/// The corners of a block's cells, 9 a side: inside or outside, and how dense.
class BlockCorners {
public:
    BlockCorners(const Surface& surface, const Vec3i& leaf);

    /// Inside bits along z of the nine corners at (x, y).
    unsigned row(int x, int y) const { return rows_[x * 9 + y]; }
    /// Raw density of a corner that was not filled.
    float value(int x, int y, int z) const {
        const int leaf = leaves_[x >> 3 << 2 | y >> 3 << 1 | z >> 3];
        const int offset = brickOffset(x & 7, y & 7, z & 7);
        return leaf >= 0 && testBit(field_.topology().voxels()[leaf], offset)
                   ? field_.density()[leaf * std::size_t{kLeafVoxels} + offset]
                   : kEmptyRaw;
    }

private:
    const VoxelField& field_;
    std::array<int, 8> leaves_;  // leaf numbers at the steps of cornerStep, or -1
    std::array<unsigned, 81> rows_{};
};

/// Raw densities of a block and one voxel around its cells: coordinates -1 to 9.
class BlockValues {
public:
    BlockValues(const Surface& surface, const Vec3i& leaf);

    /// Pointer to the value at (x, y, z); neighbours lie at +-kStride[axis].
    const float* at(int x, int y, int z) const {
        return &values_[(x + 1) * kStride[0] + (y + 1) * kStride[1] + z + 1];
    }

    static constexpr int kStride[3] = {121, 11, 1};

private:
    std::array<float, 11 * 11 * 11> values_;
};

/// Answers for the ambiguous faces of a cell: bit i is set if the inside corners of the i-th are joined.
/// On a face, the bilinear field has its saddle at (a c - b d) / (a + c - b - d), with a, c the inside corners
/// and b, d the outside ones, relative to iso: they are joined if the saddle is inside. Products of two floats
/// are exact in double, so both cells at a face give the same answer. Source: Nielson and Hamann 1991.
unsigned joinedFaces(unsigned faces, const BlockCorners& corners, const Vec3i& cell, float iso);

/// Calls visit(x, y, z, triangles) for every cell of a block that the surface runs through.
template <typename Visit>
void forEachCrossedCell(const BlockCorners& corners, float iso, const Visit& visit) {
    const CubeTable& table = cubeTable();
    for (int x = 0; x < kLeafDim; ++x)
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row[4] = {corners.row(x, y), corners.row(x, y + 1), corners.row(x + 1, y),
                                     corners.row(x + 1, y + 1)};
            const unsigned any = row[0] | row[1] | row[2] | row[3], all = row[0] & row[1] & row[2] & row[3];
            forEachBit((any | any >> 1) & ~(all & all >> 1) & 0xff, [&](int z) {
                // Bits z and z + 1 of a row are the corners (., ., 0) and (., ., 1) of the cell.
                unsigned signs = 0;
                for (int i = 0; i < 4; ++i) signs |= (row[i] >> z & 3) << (2 * i);
                const CubePattern& pattern = table.patterns[signs];
                const unsigned answers =
                    pattern.ambiguous_faces ? joinedFaces(pattern.ambiguous_faces, corners, Vec3i(x, y, z), iso)
                                            : 0;
                visit(x, y, z, table.variants[pattern.first_variant + answers]);
            });
        }
}

}  // namespace nerfvdb
