// SPDX-License-Identifier: Apache-2.0
#include "vdb/adapt.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;

namespace {

const Vec3i kDims(32, 24, 40);

bool hasCell(std::span<const LeafMask> cells, const Topology& topology, const Vec3i& ijk) {
    const int leaf = topology.findLeaf(test::floorLeaf(ijk));
    return leaf >= 0 && testBit(cells[leaf], brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7));
}

/// About half of a topology's cells.
std::vector<LeafMask> someCells(const Topology& topology, std::uint64_t seed) {
    std::vector<LeafMask> cells(topology.cells().begin(), topology.cells().end());
    for (std::size_t leaf = 0; leaf < cells.size(); ++leaf)
        for (int word = 0; word < kLeafWords; ++word) cells[leaf][word] &= randomBits(seed, leaf, word);
    return cells;
}

/// Trilinear value of channel c of a pool of bricks at a point in index space; nothing outside existing cells.
std::optional<double> valueAt(const Topology& topology, int channels, std::span<const float> pool,
                              const Vec3d& point, int c) {
    const Vec3i cell = point.array().floor().cast<int>();
    if (!hasCell(topology.cells(), topology, cell)) return std::nullopt;
    const Vec3d f = point - cell.cast<double>();
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i bit(corner >> 2, corner >> 1 & 1, corner & 1), ijk = cell + bit;
        double weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= bit[axis] ? f[axis] : 1 - f[axis];
        const std::size_t voxel =
            static_cast<std::size_t>(topology.findLeaf(test::floorLeaf(ijk))) * kLeafVoxels +
            brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
        sum += weight * pool[voxel * channels + c];
    }
    return sum;
}

template <typename Visit>
void forEachIjk(const Vec3i& dims, const Visit& visit) {
    for (int x = 0; x < dims.x(); ++x)
        for (int y = 0; y < dims.y(); ++y)
            for (int z = 0; z < dims.z(); ++z) visit(Vec3i(x, y, z));
}

}  // namespace

TEST_CASE("subdivision: a fine cell exists exactly where its coarse cell was chosen") {
    const Topology coarse = test::randomTopology(kDims, 0.2, 31);
    const std::vector<LeafMask> chosen = someCells(coarse, 32);
    const Topology fine = subdivide(coarse, chosen);
    REQUIRE(fine.dims() == kDims * 2);
    int wrong = 0;
    forEachIjk(fine.dims(), [&](const Vec3i& ijk) {
        wrong += hasCell(fine.cells(), fine, ijk) != hasCell(chosen, coarse, Vec3i(ijk / 2));
    });
    CHECK(wrong == 0);
    CHECK(fine.cellCount() > 1000);
}

TEST_CASE("half the voxel size changes nothing that can be read, at random points of random fields") {
    for (const double share : {0.05, 0.6}) {
        const VoxelField field = test::randomField(kDims, 4, share, -10.0f, 10.0f, 33);
        const VoxelField fine =
            refineField(field, subdivide(field.topology(), someCells(field.topology(), 34)));
        CHECK(fine.frame().voxel_size == 0.5 * field.frame().voxel_size);
        CHECK(fine.frame().origin == field.frame().origin);
        CHECK(fine.densityScale() == field.densityScale());
        int wrong = 0, n_read = 0;
        for (int i = 0; i < 20000; ++i) {
            Vec3d point;
            for (int axis = 0; axis < 3; ++axis) point[axis] = kDims[axis] * test::randomIn(0, 1, 35 + axis, i);
            const auto finer = valueAt(fine.topology(), 1, fine.density(), 2 * point, 0);
            if (!finer) continue;
            const auto coarse = valueAt(field.topology(), 1, field.density(), point, 0);
            // Means of up to 8 values of size 10, in single precision.
            wrong += !coarse || !(std::abs(*finer - *coarse) < 1e-5);
            for (int c = 0; c < 4; ++c)
                wrong += !(std::abs(*valueAt(fine.topology(), 4, fine.features(), 2 * point, c) -
                                    *valueAt(field.topology(), 4, field.features(), point, c)) < 1e-6);
            ++n_read;
        }
        CHECK(wrong == 0);
        CHECK(n_read > 200);
    }
}

TEST_CASE("pruning keeps the chosen cells alone, and copying keeps their values to the bit") {
    const VoxelField field = test::randomField(kDims, 4, 0.1, -10.0f, 10.0f, 36);
    const std::vector<LeafMask> chosen = someCells(field.topology(), 37);
    const VoxelField pruned = copyField(field, prune(field.topology(), chosen));
    const Topology& topology = pruned.topology();
    int wrong = 0;
    forEachIjk(kDims, [&](const Vec3i& ijk) {
        wrong += hasCell(topology.cells(), topology, ijk) != hasCell(chosen, field.topology(), ijk);
    });
    CHECK(wrong == 0);
    CHECK(pruned.frame().voxel_size == field.frame().voxel_size);
    test::forEachVoxel(topology, [&](const Vec3i& ijk, std::size_t i) {
        const std::size_t from =
            static_cast<std::size_t>(field.topology().findLeaf(test::floorLeaf(ijk))) * kLeafVoxels +
            brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
        wrong += pruned.density()[i] != field.density()[from];
        wrong += std::memcmp(&pruned.features()[4 * i], &field.features()[4 * from], 4 * sizeof(float)) != 0;
    });
    CHECK(wrong == 0);

    // Within its own memory: the same, to the last value of its bricks.
    std::vector<LeafMask> fewer = chosen;
    for (std::size_t leaf = 0; leaf < fewer.size(); ++leaf)
        if (leaf % 3 != 1) fewer[leaf] = {};
    const VoxelField copied = copyField(field, prune(field.topology(), fewer));
    const VoxelField moved = pruneField(copyField(field, field.topology()), prune(field.topology(), fewer));
    CHECK(moved.topology().leafCount() < field.topology().leafCount());
    CHECK(std::equal(moved.density().begin(), moved.density().end(), copied.density().begin(), copied.density().end()));
    CHECK(std::equal(moved.features().begin(), moved.features().end(), copied.features().begin(),
                     copied.features().end()));
    const VoxelField nothing = pruneField(copyField(field, field.topology()),
                                          prune(field.topology(), std::vector<LeafMask>(field.topology().leafCount())));
    CHECK(nothing.density().size() == 0);

    // Into a field with voxels of its own, those alone stay as they were.
    const Topology other = test::randomTopology(kDims, 0.02, 38);
    const VoxelField grown = copyField(pruned, other);
    std::size_t n_new = 0;
    test::forEachVoxel(other, [&](const Vec3i& ijk, std::size_t i) {
        const float expected = test::rawAt(pruned, ijk);
        wrong += grown.density()[i] != expected;
        n_new += expected == kEmptyRaw;
    });
    CHECK(wrong == 0);
    CHECK(n_new > 100);
}

TEST_CASE("dilation adds the 26 neighbours that exist, across leaves too") {
    const Topology topology = test::randomTopology(kDims, 0.5, 39);
    std::vector<LeafMask> few(topology.leafCount());
    for (std::size_t leaf = 0; leaf < few.size(); ++leaf)
        for (int word = 0; word < kLeafWords; ++word)
            few[leaf][word] = topology.cells()[leaf][word] & randomBits(1, leaf, word) &
                              randomBits(2, leaf, word) & randomBits(3, leaf, word) &
                              randomBits(4, leaf, word) & randomBits(5, leaf, word);
    const std::vector<LeafMask> grown = dilateCells(topology, few);
    int wrong = 0, n_grown = 0;
    forEachIjk(kDims, [&](const Vec3i& ijk) {
        bool is_near = false;
        for (int n = 0; n < 27; ++n)
            is_near = is_near || hasCell(few, topology, ijk + Vec3i(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1));
        const bool expected = is_near && hasCell(topology.cells(), topology, ijk);
        wrong += hasCell(grown, topology, ijk) != expected;
        n_grown += expected && !hasCell(few, topology, ijk);
    });
    CHECK(wrong == 0);
    CHECK(n_grown > 1000);
}
