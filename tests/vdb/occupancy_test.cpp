// SPDX-License-Identifier: Apache-2.0
#include "vdb/occupancy.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/random_field.h"

using namespace nerfvdb;

namespace {

bool hasCell(std::span<const LeafMask> cells, const Topology& topology, const Vec3i& ijk) {
    const int leaf = topology.findLeaf(test::floorLeaf(ijk));
    return leaf >= 0 && testBit(cells[leaf], brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7));
}

template <typename Visit>
void forEachIjk(const Vec3i& dims, const Visit& visit) {
    for (int x = 0; x < dims.x(); ++x)
        for (int y = 0; y < dims.y(); ++y)
            for (int z = 0; z < dims.z(); ++z) visit(Vec3i(x, y, z));
}

/// Chebyshev distance from every leaf to the nearest that has an occupied cell, by looking at all of them; in nodes
/// where a whole node has none.
int countWrongDistances(const Topology& topology, const Occupancy& occupancy) {
    const Vec3i dims = topology.dims() / kLeafDim;
    REQUIRE(occupancy.skip.dims == dims);
    int wrong = 0;
    forEachIjk(dims, [&](const Vec3i& here) {
        int nearest = std::numeric_limits<int>::max(), nearest_node = occupancy.skip.node_dims.maxCoeff() + 1;
        for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
            if (occupancy.cells[leaf] != LeafMask{}) {
                const Vec3i& there = topology.leafCoords()[leaf];
                nearest = std::min(nearest, (there - here).cwiseAbs().maxCoeff());
                nearest_node = std::min(nearest_node, (there / kNodeDim - here / kNodeDim).cwiseAbs().maxCoeff());
            }
        const std::int32_t entry = occupancy.skip.at(here);
        if (nearest == 0) wrong += entry != topology.findLeaf(here);
        else wrong += entry != -(nearest_node > 0 ? nearest_node : std::min(nearest, kNodeDim + 1));
    });
    return wrong;
}

}  // namespace

TEST_CASE("a cell is occupied exactly when it exists and its densest corner stops enough light") {
    const Vec3i dims(32, 24, 40);
    for (const double share : {0.02, 0.5, 1.0})
        for (const float min_alpha : {0.001f, 0.1f, 0.9f}) {
            CAPTURE(share, min_alpha);
            const VoxelField field = test::randomField(dims, 4, share, -9.0f, 1.5f, 3);
            const Topology& topology = field.topology();
            const Occupancy occupancy = findOccupied(field, min_alpha);
            int wrong = 0;
            std::size_t n_occupied = 0;
            forEachIjk(dims, [&](const Vec3i& ijk) {
                float densest = kEmptyRaw;
                for (int corner = 0; corner < 8; ++corner)
                    densest = std::max(
                        densest, test::rawAt(field, ijk + Vec3i(corner >> 2, corner >> 1 & 1, corner & 1)));
                const double tau = 10.0 * 0.1 * std::exp(static_cast<double>(densest));  // random_field.h
                const bool expected =
                    hasCell(topology.cells(), topology, ijk) && -std::expm1(-tau) >= min_alpha;
                // Nothing random lies within rounding of the threshold.
                wrong += hasCell(occupancy.cells, topology, ijk) != expected;
                n_occupied += expected;
            });
            CHECK(wrong == 0);
            CHECK(occupancy.cellCount() == n_occupied);
            CHECK(n_occupied > 0);
            CHECK(occupancy.leafCount() == static_cast<std::size_t>(std::count_if(
                                               occupancy.cells.begin(), occupancy.cells.end(),
                                               [](const LeafMask& mask) { return mask != LeafMask{}; })));
        }
}

TEST_CASE("whatever its value, a voxel that does not exist occupies nothing") {
    VoxelField field = test::randomField(Vec3i(16, 16, 16), 4, 0.05, -15.0f, -14.0f, 4);
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        for (int offset = 0; offset < kLeafVoxels; ++offset)
            if (!testBit(field.topology().voxels()[leaf], offset))
                field.density()[leaf * kLeafVoxels + offset] = 10.0f;
    CHECK(findOccupied(field, 0.01f).cellCount() == 0);
}

TEST_CASE("the thresholds' ends: none lets every existing cell in, total opacity none") {
    const VoxelField field = test::randomField(Vec3i(16, 16, 16), 4, 0.3, -15.0f, 14.0f, 5);
    CHECK(findOccupied(field, 0.0f).cellCount() == field.topology().cellCount());
    CHECK(findOccupied(field, 1.0f).cellCount() == 0);
}

TEST_CASE("the skip table holds the Chebyshev distance to the nearest occupied leaf") {
    const Vec3i dims(328, 72, 264);  // 6 x 2 x 5 nodes, the last ones cut off
    for (const double share : {0.0, 5e-7, 2e-6, 2e-5, 5e-4}) {
        CAPTURE(share);
        const Topology topology = test::randomTopology(dims, share, 7);
        CHECK(countWrongDistances(topology, occupancyFromCells(topology, {topology.cells().begin(),
                                                                          topology.cells().end()})) == 0);
    }
    // Leaves without an occupied cell, or that only hold upper corners, are jumped like absent ones.
    const Topology topology = test::randomTopology(dims, 2e-5, 8);
    std::vector<LeafMask> cells(topology.cells().begin(), topology.cells().end());
    for (std::size_t leaf = 0; leaf < cells.size(); leaf += 2) cells[leaf] = {};
    CHECK(countWrongDistances(topology, occupancyFromCells(topology, cells)) == 0);
}
