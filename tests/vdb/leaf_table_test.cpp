// SPDX-License-Identifier: Apache-2.0
#include "vdb/leaf_table.h"

#include <map>
#include <tuple>

#include "core/random.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("a table of leaves says what was set, and the same nothing everywhere else") {
    const Vec3i dims(37, 9, 64);
    LeafTable table(dims, -7);
    std::map<std::tuple<int, int, int>, std::int32_t> expected;
    for (int i = 0; i < 40; ++i) {
        Vec3i leaf;
        for (int axis = 0; axis < 3; ++axis)
            leaf[axis] = static_cast<int>(randomBits(5, axis, i) % static_cast<unsigned>(dims[axis]));
        table.touch(leaf) = i;
        expected[{leaf.x(), leaf.y(), leaf.z()}] = i;
    }
    int wrong = 0;
    for (int x = 0; x < dims.x(); ++x)
        for (int y = 0; y < dims.y(); ++y)
            for (int z = 0; z < dims.z(); ++z) {
                const auto found = expected.find({x, y, z});
                wrong += table.at({x, y, z}) != (found == expected.end() ? -7 : found->second);
            }
    CHECK(wrong == 0);
    CHECK(table.contains(dims - Vec3i::Ones()));
    CHECK_FALSE(table.contains({37, 0, 0}));
    CHECK_FALSE(table.contains({0, -1, 0}));
}

TEST_CASE("a table of leaves grows with what exists, not with the box") {
    LeafTable table(Vec3i::Constant(1 << 10), -1);  // 8192 voxels along each edge
    for (int i = 0; i < 8; ++i) table.touch(Vec3i(7 + i, 100, 100)) = i;  // in two nodes
    CHECK(table.leaves.size() == 2 * kNodeLeaves);
    CHECK(table.bytes() < std::size_t{9} << 20);  // a number for each leaf would be 4 GiB
}
