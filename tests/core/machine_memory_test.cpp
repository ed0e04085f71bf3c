// SPDX-License-Identifier: Apache-2.0
#include "core/machine_memory.h"

#include <fstream>

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("the machine's memory is no more than the system tells") {
    std::ifstream told("/proc/meminfo");
    std::string name;
    std::size_t kib = 0;
    if (told >> name >> kib && name == "MemTotal:") CHECK(machineMemory() <= kib << 10);
    CHECK(machineMemory() >= std::size_t{64} << 20);  // this test runs in it
}
