// SPDX-License-Identifier: Apache-2.0
#include "cli/json_output.h"

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

TEST_CASE("results that find no room name the file that was asked for, and leave the old one", "[cli]") {
    const TempDir folder;
    const std::string target = folder / "results.json";
    writeJson(target, {{"psnr", 30}});
    const std::string before = readFile(target);
    {
        const SmallDisk full_disk(50);
        const Json much = {{"notes", std::string(1000, 'x')}};
        CHECK_THROWS_AS(writeJson(target, much), IoError);
        CHECK_THROWS_WITH(writeJson(target, much), Catch::StartsWith(target + ": found"));
    }
    CHECK(readFile(target) == before);
    CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);  // no temporary stays
}
