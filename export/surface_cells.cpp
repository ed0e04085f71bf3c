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

}  // namespace

Surface cutField(const VoxelField& field, float iso) {
    const Topology& topology = field.topology();
    const std::size_t n_leaves = topology.leafCount();
    Surface surface{field, iso, std::vector<LeafMask>(n_leaves), -std::numeric_limits<float>::infinity(), {}};
    std::vector<float> largest(n_leaves, surface.largest_raw);
    std::atomic<bool> is_absurd = false;
    parallelRanges(n_leaves, kLeavesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t leaf = begin; leaf < end; ++leaf) {
            const float* brick = &field.density()[leaf * kLeafVoxels];
            for (int x = 0; x < kLeafWords; ++x)
                forEachBit(topology.voxels()[leaf][x], [&](int bit) {
                    const float raw = brick[x * 64 + bit];
                    if (!(std::abs(raw) < kAbsurdRaw)) is_absurd = true;  // written so that NaN is absurd, too
                    largest[leaf] = std::max(largest[leaf], raw);
                    surface.inside[leaf][x] |= static_cast<std::uint64_t>(raw >= iso) << bit;
                });
        }
    });
    if (is_absurd)
        throw NumericError("mesh: raw density", "a value that is infinite, not a number or beyond 1e15",
                           "finite values", "the model is damaged or its training diverged");
    for (const float raw : largest) surface.largest_raw = std::max(surface.largest_raw, raw);
    return surface;
}

CornerRows::CornerRows(const Surface& surface, const Vec3i& leaf) {
    static constexpr std::uint64_t kAll = ~std::uint64_t{0};
    static constexpr LeafMask kEnclosed{kAll, kAll, kAll, kAll, kAll, kAll, kAll, kAll};
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i step = cornerStep(corner);
        const int number = surface.field.topology().findLeaf(leaf + step);
        if (number < 0 && !surface.enclosed.contains(leaf + step)) continue;
        const LeafMask& mask = number < 0 ? kEnclosed : surface.inside[number];
        for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x)
            for (int y = 0; y < (step.y() ? 1 : kLeafDim); ++y) {
                const unsigned bits = mask[x] >> (8 * y) & 0xff;
                rows_[(x + 8 * step.x()) * 9 + y + 8 * step.y()] |= step.z() ? (bits & 1) << 8 : bits;
            }
    }
}

void BlockValues::gather() {
    const Topology& topology = surface_.field.topology();
    // Along each axis: the last voxel of the block before, the block, the first two of the block after.
    constexpr int kFirst[3] = {7, 0, 0}, kCount[3] = {1, 8, 2}, kPlace[3] = {0, 1, 9};
    values_.fill(kEmptyRaw);
    for (int i = 0; i < 27; ++i) {
        const int block[3] = {i / 9, i / 3 % 3, i % 3};
        const Vec3i leaf = leaf_ + Vec3i(block[0] - 1, block[1] - 1, block[2] - 1);
        const int number = topology.findLeaf(leaf);
        const bool is_enclosed = number < 0 && surface_.enclosed.contains(leaf);
        if (number < 0 && !is_enclosed) continue;
        const float* brick =
            is_enclosed ? nullptr : &surface_.field.density()[number * std::size_t{kLeafVoxels}];
        for (int x = 0; x < kCount[block[0]]; ++x)
            for (int y = 0; y < kCount[block[1]]; ++y) {
                const int offset = brickOffset(kFirst[block[0]] + x, kFirst[block[1]] + y, kFirst[block[2]]);
                float* row = &values_[(kPlace[block[0]] + x) * kStride[0] +
                                      (kPlace[block[1]] + y) * kStride[1] + kPlace[block[2]]];
                for (int z = 0; z < kCount[block[2]]; ++z) {
                    if (!is_enclosed && testBit(topology.voxels()[number], offset + z))
                        row[z] = brick[offset + z];
                    const bool is_inside = is_enclosed || testBit(surface_.inside[number], offset + z);
                    if (is_inside && row[z] < surface_.iso) row[z] = kFilledRaw;
                }
            }
    }
    is_gathered_ = true;
}

unsigned joinedFaces(unsigned faces, const float* corner, float iso) {
    const CubeTable& table = cubeTable();
    unsigned answers = 0;
    int n = 0;
    for (int face = 0; face < 6; ++face) {
        if (!(faces >> face & 1)) continue;
        double value[4];
        for (int i = 0; i < 4; ++i) {
            const Vec3i step = cornerStep(table.face_corners[face][i]);
            value[i] =
                corner[step.x() * BlockValues::kStride[0] + step.y() * BlockValues::kStride[1] + step.z()] -
                iso;
        }
        const double even = value[0] * value[2], odd = value[1] * value[3];
        const bool is_even_inside = value[0] >= 0;
        answers |= static_cast<unsigned>(is_even_inside ? even >= odd : odd >= even) << n++;
    }
    return answers;
}

}  // namespace nerfvdb
