// SPDX-License-Identifier: Apache-2.0
#include "export/surface_cells.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

// Densities beyond this are no densities; below it, squares and sums of differences stay finite in float.
constexpr float kAbsurdRaw = 1e15f;
constexpr std::size_t kLeavesPerTask = 32;

/// Bits of one row of eight voxels that are at least iso.
unsigned rowInside(const float* row, float iso) {
    // Weights summed without a branch: compilers make vectors of it.
    static constexpr int kBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
    int bits = 0;
    for (int z = 0; z < 8; ++z) bits |= row[z] >= iso ? kBit[z] : 0;
    return static_cast<unsigned>(bits);
}

/// One row of eight voxels, kEmptyRaw where `active` has no bit.
void copyActive(const float* from, unsigned active, float* to) {
    static constexpr unsigned kBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
    for (int z = 0; z < 8; ++z) to[z] = active & kBit[z] ? from[z] : kEmptyRaw;
}

/// Bits [low, high] of eight, both cut to what exists.
unsigned rangeBits(int low, int high) {
    low = std::max(low, 0), high = std::min(high, 7);
    return low > high ? 0 : (0xffu >> (7 - high)) & (0xffu << low);
}

}  // namespace

LeafMask VoxelBox::maskOf(const Vec3i& leaf) const {
    const Vec3i low = min - leaf * kLeafDim, high = max - leaf * kLeafDim;
    const unsigned x = rangeBits(low.x(), high.x()), y = rangeBits(low.y(), high.y()),
                   z = rangeBits(low.z(), high.z());
    std::uint64_t word = 0;
    for (int i = 0; i < kLeafDim; ++i) word |= (y >> i & 1 ? std::uint64_t{z} : 0) << (8 * i);
    LeafMask mask;
    for (int i = 0; i < kLeafWords; ++i) mask[i] = x >> i & 1 ? word : 0;
    return mask;
}

Surface cutField(const VoxelField& field, float iso) {
    const Topology& topology = field.topology();
    const std::size_t n_leaves = topology.leafCount();
    Surface surface{field, iso, std::vector<LeafMask>(n_leaves), -std::numeric_limits<float>::infinity()};
    std::vector<float> largest(n_leaves, surface.largest_raw);
    std::atomic<bool> is_absurd = false;
    parallelRanges(n_leaves, kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t leaf = begin; leaf < end; ++leaf) {
            const float* row = &field.density()[leaf * kLeafVoxels];
            float values[kLeafDim];
            float top = surface.largest_raw, bottom = 0;
            bool is_number = true;
            for (int x = 0; x < kLeafWords; ++x)
                for (int y = 0; y < kLeafDim; ++y, row += kLeafDim) {
                    const unsigned active = topology.voxels()[leaf][x] >> (8 * y) & 0xff;
                    if (!active) continue;
                    copyActive(row, active, values);
                    for (const float raw : values) {
                        is_number &= raw == raw;
                        top = std::max(top, raw);
                        bottom = std::min(bottom, raw);
                    }
                    surface.inside[leaf][x] |= std::uint64_t{rowInside(values, iso) & active} << (8 * y);
                }
            if (!is_number || top >= kAbsurdRaw || bottom <= -kAbsurdRaw) is_absurd = true;
            largest[leaf] = top;
        }
    });
    if (is_absurd)
        throw NumericError("mesh: raw density", "a value that is infinite, not a number or beyond 1e15",
                           "finite values", "the model is damaged or its training diverged");
    for (const float raw : largest) surface.largest_raw = std::max(surface.largest_raw, raw);
    return surface;
}

void clipSurface(Surface& surface, const VoxelBox& bounds) {
    surface.bounds = bounds;
    for (std::size_t leaf = 0; leaf < surface.inside.size(); ++leaf) {
        const LeafMask kept = bounds.maskOf(surface.field.topology().leafCoords()[leaf]);
        for (int x = 0; x < kLeafWords; ++x) surface.inside[leaf][x] &= kept[x];
    }
}

BlockCorners::BlockCorners(const Surface& surface, const Vec3i& leaf) : field_(surface.field) {
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i step = cornerStep(corner);
        const int number = leaves_[corner] = field_.topology().findLeaf(leaf + step);
        if (number < 0 && !surface.enclosed.contains(leaf + step)) continue;
        const LeafMask mask = number < 0 ? surface.bounds.maskOf(leaf + step) : surface.inside[number];
        for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x)
            for (int y = 0; y < (step.y() ? 1 : kLeafDim); ++y) {
                const unsigned bits = mask[x] >> (8 * y) & 0xff;
                rows_[(x + 8 * step.x()) * 9 + y + 8 * step.y()] |= step.z() ? (bits & 1) << 8 : bits;
            }
    }
}

BlockValues::BlockValues(const Surface& surface, const Vec3i& leaf) {
    const Topology& topology = surface.field.topology();
    // Along each axis: the last voxel of the block before, the block, the first two of the block after.
    static constexpr int kFirst[3] = {7, 0, 0}, kCount[3] = {1, 8, 2}, kPlace[3] = {0, 1, 9};
    values_.fill(kEmptyRaw);
    for (int i = 0; i < 27; ++i) {
        const int block[3] = {i / 9, i / 3 % 3, i % 3};
        const Vec3i place = leaf + Vec3i(block[0] - 1, block[1] - 1, block[2] - 1);
        const int number = topology.findLeaf(place);
        const bool is_enclosed = number < 0 && surface.enclosed.contains(place);
        if (number < 0 && !is_enclosed) continue;
        const float* brick =
            is_enclosed ? nullptr : &surface.field.density()[number * std::size_t{kLeafVoxels}];
        for (int x = 0; x < kCount[block[0]]; ++x)
            for (int y = 0; y < kCount[block[1]]; ++y) {
                float* row = &values_[(kPlace[block[0]] + x) * kStride[0] +
                                      (kPlace[block[1]] + y) * kStride[1] + kPlace[block[2]]];
                if (is_enclosed) {
                    std::fill_n(row, kCount[block[2]], kFilledRaw);
                    continue;
                }
                const int word = kFirst[block[0]] + x, bit = 8 * (kFirst[block[1]] + y) + kFirst[block[2]];
                const float* from = brick + word * 64 + bit;
                const std::uint64_t active = topology.voxels()[number][word] >> bit;
                if (block[2] == 1)
                    copyActive(from, active & 0xff, row);
                else
                    for (int z = 0; z < kCount[block[2]]; ++z)
                        if (active >> z & 1) row[z] = from[z];
                if (surface.is_filled)
                    for (int z = 0; z < kCount[block[2]]; ++z)
                        if (surface.inside[number][word] >> (bit + z) & 1 && row[z] < surface.iso)
                            row[z] = kFilledRaw;
            }
    }
}

unsigned joinedFaces(unsigned faces, const BlockCorners& corners, const Vec3i& cell, float iso) {
    const CubeTable& table = cubeTable();
    unsigned answers = 0;
    int n = 0;
    for (int face = 0; face < 6; ++face) {
        if (!(faces >> face & 1)) continue;
        double value[4];
        for (int i = 0; i < 4; ++i) {
            const Vec3i corner = cell + cornerStep(table.face_corners[face][i]);
            value[i] = corners.value(corner.x(), corner.y(), corner.z()) - iso;
        }
        const double even = value[0] * value[2], odd = value[1] * value[3];
        const bool is_even_inside = value[0] >= 0;
        answers |= static_cast<unsigned>(is_even_inside ? even >= odd : odd >= even) << n++;
    }
    return answers;
}

}  // namespace nerfvdb
