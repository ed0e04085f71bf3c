// SPDX-License-Identifier: Apache-2.0
#include "vdb/block_grid.h"

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

double unit(std::uint64_t stream, std::uint64_t index) {
    return unitFloat(static_cast<std::uint32_t>(randomBits(11, stream, index)));
}

/// A street, a town from above, a tower, a place far from zero, one cell.
const std::vector<std::pair<Box, Vec3i>>& cuts() {  // columns, rows, up
    static const std::vector<std::pair<Box, Vec3i>> all = {{{{0, -10, 0}, {200, 10, 12}}, {10, 1, 2}},
                                                           {{{-300, -200, 0}, {300, 200, 60}}, {3, 2, 2}},
                                                           {{{0, 0, 0}, {4, 90, 5}}, {2, 3, 1}},
                                                           {{{5e6, 4e6, -3}, {5e6 + 80, 4e6 + 30, 9}}, {1, 4, 2}},
                                                           {{{0, 0, 0}, {1, 2, 3}}, {1, 1, 0}}};
    return all;
}

BlockGrid gridOf(const std::pair<Box, Vec3i>& cut) {
    return cutIntoBlocks(cut.first, cut.second.z(), cut.second.x(), cut.second.y());
}

}  // namespace

TEST_CASE("blocks cover the region, in whole voxels of one lattice", "[vdb]") {
    for (const auto& cut : cuts()) {
        const BlockGrid grid = gridOf(cut);
        const double slack = 1e-9 * (1 + cut.first.max.norm());
        CAPTURE(grid.columns, grid.rows, grid.voxel_size);
        CHECK((grid.region().min.array() <= cut.first.min.array() + slack).all());
        CHECK((grid.region().max.array() >= cut.first.max.array() - slack).all());
        int longest = 0;
        for (const BlockId& block : grid.blocks()) {
            CHECK(grid.has(block));
            const Vec3d voxels = grid.box(block).size() / grid.voxel_size;
            for (int axis = 0; axis < 3; ++axis) {
                const double eighths = voxels[axis] / 8;
                CHECK(std::abs(eighths - std::round(eighths)) < 1e-6);  // 5e6 in a double leaves 1e-9 of a unit
                CHECK((grid.box(block).min[axis] <= grid.coreBox(block).min[axis]));
                CHECK((grid.box(block).max[axis] >= grid.coreBox(block).max[axis]));
            }
            CHECK((grid.coreCorner(block).array() / 8 * 8 == grid.coreCorner(block).array()).all());
            longest = std::max(longest, static_cast<int>(std::lround(voxels.maxCoeff())));
        }
        CHECK(longest == BlockGrid::kResolution);
        CHECK_FALSE(grid.has({grid.columns, 0}));
        CHECK_FALSE(grid.has({0, -1}));
    }
}

TEST_CASE("blocks share out every place, without jumps, and only what their boxes hold", "[vdb]") {
    for (const auto& cut : cuts()) {
        const BlockGrid grid = gridOf(cut);
        const Box region = grid.region();
        const double step = 1e-3 * grid.voxel_size;
        for (std::uint64_t n = 0; n < 300; ++n) {
            Vec3d at;  // also beyond the region
            for (int axis = 0; axis < 3; ++axis)
                at[axis] = region.min[axis] + (1.4 * unit(axis, n) - 0.2) * region.size()[axis];
            double sum = 0;
            for (const BlockId& block : grid.blocks()) {
                const double weight = grid.weight(block, at);
                CHECK(weight >= 0);
                sum += weight;
                const Vec3d aside = at + Vec3d::Constant(step);
                // Two ramps of 1 / (2 kFade) a voxel.
                CHECK(std::abs(grid.weight(block, aside) - weight) <=
                      2 * 1e-3 / (2 * BlockGrid::kFade) + 1e-6);  // and what a double keeps of 5e6
                if (weight > 0) {
                    CHECK(grid.takesCameraAt(block, at));
                    // Well inside of its box, so that what is near is fine: the margin less the fade.
                    const double spare = (BlockGrid::kMargin - BlockGrid::kFade) * grid.voxel_size * (1 - 1e-6);
                    const Box box = grid.box(block);
                    for (const int axis : {grid.axisOfColumns(), grid.axisOfRows()}) {
                        const Vec3d within = at.cwiseMax(region.min).cwiseMin(region.max);
                        if (grid.countAlong(axis) == 1) continue;
                        CHECK(within[axis] - box.min[axis] >= spare);
                        CHECK(box.max[axis] - within[axis] >= spare);
                    }
                }
            }
            CHECK(sum == Approx(1).margin(1e-12));
        }
        for (const BlockId& block : grid.blocks()) CHECK(grid.weight(block, grid.coreBox(block).center()) == 1);
    }
}

TEST_CASE("cuts that cannot be are refused", "[vdb]") {
    const Box box{{0, 0, 0}, {1, 1, 1}};
    CHECK_THROWS_AS(cutIntoBlocks(box, 2, 0, 1), UsageError);
    CHECK_THROWS_AS(cutIntoBlocks(box, 2, 1, kMostBlocks + 1), UsageError);
    CHECK_THROWS_AS(cutIntoBlocks({{0, 0, 0}, {1, 0, 1}}, 2, 2, 1), UsageError);
    CHECK_THROWS_AS(cutIntoBlocks({{0, 0, 0}, {1, NAN, 1}}, 2, 2, 1), UsageError);
    CHECK_THROWS_AS(cutIntoBlocks({{0, 0, 0}, {1, INFINITY, 1}}, 2, 2, 1), UsageError);
}
