// SPDX-License-Identifier: Apache-2.0
#include "trainer/memory_plan.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kLeafArrays = 512 * (8 + 3) * sizeof(float);  // eight features, a density, two moments

}  // namespace

TEST_CASE("a leaf costs its arrays and its tables, a photograph what it is") {
    const MemoryPlan plan(0, 8, 4096, 2), with_photographs(100 * kMiB, 8, 4096, 2);
    const std::size_t leaf = plan.training(1001) - plan.training(1000);
    CHECK(leaf >= kLeafArrays + 172 + 64 + 64);
    CHECK(leaf < 2 * kLeafArrays);
    CHECK(with_photographs.training(1000) == plan.training(1000) + 100 * kMiB);
    CHECK(with_photographs.refining(1000, 4000) == plan.refining(1000, 4000) + 100 * kMiB);
}

TEST_CASE("refining needs more than what it ends with, and less than both fields side by side") {
    for (const int channels : {4, 8, 16}) {
        const MemoryPlan plan(0, channels, 4096, 2);
        const std::size_t arrays = 512 * (static_cast<std::size_t>(channels) + 3) * sizeof(float);
        for (const std::size_t fine : {std::size_t{1000}, std::size_t{4000}, std::size_t{8000}}) {
            CAPTURE(channels, fine);
            CHECK(plan.refining(1000, fine) > plan.training(fine));
            CHECK(plan.refining(1000, fine) < plan.training(fine) + 1000 * arrays);
        }
    }
}

TEST_CASE("photographs have half of what the program leaves") {
    CHECK(photographRoom(0) == 0);
    CHECK(photographRoom(100 * kMiB) == 0);
    CHECK(photographRoom(330 * kMiB) == 100 * kMiB);
}
