// SPDX-License-Identifier: Apache-2.0
// Real scenes that some tests want and the project does not carry. They are looked for in $NERFVDB_DATA, else
// in
// ../shared/data beside the source tree; a test whose data is absent is reported as skipped.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>

namespace nerfvdb::testing {

/// Where a piece of data such as "fox" or "nerf_synthetic/lego" is; it may not exist.
inline std::filesystem::path dataPath(const std::string& name) {
    const char* root = std::getenv("NERFVDB_DATA");
    return std::filesystem::path(root ? root : NERFVDB_SOURCE_DIR "/../shared/data") / name;
}

/// Number of test cases that were skipped.
inline std::size_t& skippedTests() {
    static std::size_t count = 0;
    return count;
}

}  // namespace nerfvdb::testing

/// Leaves the test case, marked as skipped, unless the path exists. Use outside sections.
#define NERFVDB_NEEDS(path)                                                    \
    do {                                                                       \
        if (!std::filesystem::exists(path)) {                                  \
            std::cout << "skipped: " << (path) << " is not here" << std::endl; \
            ++nerfvdb::testing::skippedTests();                                \
            return;                                                            \
        }                                                                      \
    } while (false)
