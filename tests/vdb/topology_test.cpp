// SPDX-License-Identifier: Apache-2.0
#include "vdb/topology.h"

#include <set>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// Random cells in a box, once as a topology and once as a plain set of coordinates.
struct RandomCells {
    std::set<std::array<int, 3>> cells;
    Topology topology;

    RandomCells(const Vec3i& dims, int n, std::uint64_t seed) {
        std::vector<Topology::LeafCells> entries;
        for (int i = 0; i < n; ++i) {
            Vec3i cell;
            for (int axis = 0; axis < 3; ++axis)
                cell[axis] = static_cast<int>(randomBits(seed, i, axis) % static_cast<std::uint64_t>(dims[axis] - 1));
            cells.insert({cell.x(), cell.y(), cell.z()});
            LeafMask mask{};
            setBit(mask, brickOffset(cell.x() & 7, cell.y() & 7, cell.z() & 7));
            entries.push_back({cell / 8, mask});
        }
        topology = Topology(dims, entries);
    }
};

}  // namespace

TEST_CASE("topology holds exactly the given cells and their corners") {
    const RandomCells random(Vec3i(32, 24, 40), 300, 7);
    const Topology& topology = random.topology;
    std::set<std::array<int, 3>> corners;
    for (const auto& [x, y, z] : random.cells)
        for (int c = 0; c < 8; ++c) corners.insert({x + (c >> 2), y + (c >> 1 & 1), z + (c & 1)});

    CHECK(topology.cellCount() == random.cells.size());
    CHECK(topology.voxelCount() == corners.size());
    std::size_t wrong = 0;
    for (int x = 0; x < 32; ++x)
        for (int y = 0; y < 24; ++y)
            for (int z = 0; z < 40; ++z) {
                const int leaf = topology.findLeaf(Vec3i(x / 8, y / 8, z / 8));
                const int offset = brickOffset(x & 7, y & 7, z & 7);
                const bool is_cell = leaf >= 0 && testBit(topology.cells()[leaf], offset);
                const bool is_voxel = leaf >= 0 && testBit(topology.voxels()[leaf], offset);
                wrong += is_cell != (random.cells.count({x, y, z}) > 0);
                wrong += is_voxel != (corners.count({x, y, z}) > 0);
            }
    CHECK(wrong == 0);
}

TEST_CASE("every corner of a cell is reached through the upper neighbours") {
    const RandomCells random(Vec3i(32, 24, 40), 300, 8);
    const Topology& topology = random.topology;
    std::size_t wrong = 0;
    for (const auto& [x, y, z] : random.cells) {
        const int leaf = topology.findLeaf(Vec3i(x / 8, y / 8, z / 8));
        REQUIRE(leaf >= 0);
        for (int c = 0; c < 8; ++c) {
            const Vec3i corner(x + (c >> 2), y + (c >> 1 & 1), z + (c & 1));
            const int crossed = ((x & 7) + (c >> 2) == 8) * 4 + ((y & 7) + (c >> 1 & 1) == 8) * 2 + ((z & 7) + (c & 1) == 8);
            wrong += topology.upperNeighbours()[leaf * 8 + crossed] != topology.findLeaf(corner / 8);
        }
    }
    CHECK(wrong == 0);
}

TEST_CASE("topology refuses cells outside its box, and dimensions that are no multiple of a leaf") {
    LeafMask mask{};
    setBit(mask, brickOffset(7, 0, 0));  // its upper corner would be voxel 8 of 8
    const Topology::LeafCells touching{Vec3i(0, 0, 0), mask};
    CHECK_THROWS_AS(Topology(Vec3i(8, 8, 8), std::span(&touching, 1)), UsageError);
    const Topology::LeafCells outside{Vec3i(1, 0, 0), mask};
    CHECK_THROWS_AS(Topology(Vec3i(8, 8, 8), std::span(&outside, 1)), UsageError);
    CHECK_THROWS_AS(Topology(Vec3i(8, 9, 8), {}), UsageError);
    CHECK(Topology(Vec3i(8, 8, 8), {}).leafCount() == 0);
    CHECK(Topology(Vec3i(8, 8, 8), {}).findLeaf(Vec3i(-1, 0, 0)) == -1);
}
