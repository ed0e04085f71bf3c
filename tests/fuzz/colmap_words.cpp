// SPDX-License-Identifier: Apache-2.0
// What COLMAP says while it works: each line alone, and all as its --help.
#include <sstream>

#include "tests/fuzz/reader.h"
#include "trainer/colmap_output.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::istringstream text{std::string(fuzz::textOf(data, size))};
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) {
        parseColmapLine(line);
        lines.push_back(line);
    }
    fuzz::require(colmapOptions(lines).size() <= lines.size(), "at most an option a line");
    return 0;
}
