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

/// A field cut at a raw density, and the voxels inside.
struct Surface {
    const VoxelField& field;
    float iso;                     // raw density
    std::vector<LeafMask> inside;  // [leaf] active voxels with raw >= iso, and what was filled
    float largest_raw;             // of all active voxels; -infinity without any
    LeafSet enclosed;              // places without a leaf that were filled
};

/// Throws NumericError when the density of an active voxel is not finite or beyond 1e15.
Surface cutField(const VoxelField& field, float iso);

/// Inside bits of the 9^3 corners of a block's cells: for each (x, y) a row of nine bits along z.
class CornerRows {
public:
    CornerRows(const Surface& surface, const Vec3i& leaf);
    unsigned row(int x, int y) const { return rows_[x * 9 + y]; }

private:
    std::array<unsigned, 81> rows_{};
};

/// Raw densities of a block and one voxel around its cells: coordinates -1 to 9. Gathered on first use.
class BlockValues {
public:
    BlockValues(const Surface& surface, const Vec3i& leaf) : surface_(surface), leaf_(leaf) {}

    /// Pointer to the value at (x, y, z); neighbours lie at +-kStride[axis].
    const float* at(int x, int y, int z) {
        if (!is_gathered_) gather();
        return &values_[(x + 1) * kStride[0] + (y + 1) * kStride[1] + z + 1];
    }

    static constexpr int kStride[3] = {121, 11, 1};

private:
    void gather();

    const Surface& surface_;
    Vec3i leaf_;
    bool is_gathered_ = false;
    std::array<float, 11 * 11 * 11> values_;
};

/// Answers for the ambiguous faces of a cell: bit i is set if the inside corners of the i-th are joined.
/// On a face, the bilinear field has its saddle at (a c - b d) / (a + c - b - d), with a, c the inside corners
/// and b, d the outside ones, relative to iso: they are joined if the saddle is inside. Products of two floats
/// are exact in double, so both cells at a face give the same answer. Source: Nielson and Hamann 1991.
unsigned joinedFaces(unsigned faces, const float* corner, float iso);

/// Calls visit(x, y, z, triangles) for every cell of a block that the surface runs through.
template <typename Visit>
void forEachCrossedCell(const CornerRows& rows, BlockValues& values, float iso, const Visit& visit) {
    const CubeTable& table = cubeTable();
    for (int x = 0; x < kLeafDim; ++x)
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row[4] = {rows.row(x, y), rows.row(x, y + 1), rows.row(x + 1, y),
                                     rows.row(x + 1, y + 1)};
            const unsigned any = row[0] | row[1] | row[2] | row[3], all = row[0] & row[1] & row[2] & row[3];
            forEachBit((any | any >> 1) & ~(all & all >> 1) & 0xff, [&](int z) {
                // Bits z and z + 1 of a row are the corners (., ., 0) and (., ., 1) of the cell.
                unsigned corners = 0;
                for (int i = 0; i < 4; ++i) corners |= (row[i] >> z & 3) << (2 * i);
                const CubePattern& pattern = table.patterns[corners];
                const unsigned answers =
                    pattern.ambiguous_faces ? joinedFaces(pattern.ambiguous_faces, values.at(x, y, z), iso) : 0;
                visit(x, y, z, table.variants[pattern.first_variant + answers]);
            });
        }
}

}  // namespace nerfvdb
