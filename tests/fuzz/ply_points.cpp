// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/reader.h"
#include "trainer/ply_points.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "points.ply");
    fuzz::isRead([&] { fuzz::require(6 * readPlyPoints(file).size() <= size, "no more points than six bytes each"); });
    return 0;
}
