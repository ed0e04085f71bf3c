// SPDX-License-Identifier: Apache-2.0
#include "trainer/block_index.h"

#include <fstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

namespace {

BlockIndex someIndex() {
    return {cutIntoBlocks({{0.1, -1.0 / 3, 1e-3}, {200.7, 20, 12}}, 2, 3, 2), {5, 0, 9, 2, 3, 7}};
}

}  // namespace

TEST_CASE("blocks.json keeps every bit of a grid", "[trainer]") {
    const TempDir folder;
    CHECK_FALSE(isBlockFolder(folder.path()));
    const BlockIndex index = someIndex();
    writeBlockIndex(folder.path(), index);
    CHECK(isBlockFolder(folder.path()));
    CHECK(isBlockFolder(folder.path() / "blocks.json"));
    CHECK(readBlockIndex(folder.path()) == index);
    CHECK(readBlockIndex(folder.path() / "blocks.json") == index);
    writeBlockIndex(folder.path(), index);  // by another process that trains another block
}

TEST_CASE("blocks with fewer than three photographs have no model", "[trainer]") {
    const BlockIndex index = someIndex();
    CHECK(index.isTrained({0, 0}));
    CHECK_FALSE(index.isTrained({0, 1}));
    CHECK(index.isTrained({1, 0}));
    CHECK_FALSE(index.isTrained({1, 1}));
    CHECK(index.isTrained({2, 0}));
    CHECK(blockName({2, 1}) == "2,1");
    CHECK(blockPath("town", {2, 1}) == std::filesystem::path("town/block_2_1.vdb"));
}

TEST_CASE("a folder keeps to one way to cut", "[trainer]") {
    const TempDir folder;
    writeBlockIndex(folder.path(), someIndex());
    BlockIndex other = someIndex();
    other.views[0] = 6;
    CHECK_THROWS_WITH(writeBlockIndex(folder.path(), other), Catch::Contains("cut in another way"));
    CHECK(readBlockIndex(folder.path()) == someIndex());
}

TEST_CASE("a blocks.json that lies is refused by file and field", "[trainer]") {
    const TempDir folder;
    writeBlockIndex(folder.path(), someIndex());
    const std::filesystem::path file = folder.path() / "blocks.json";
    const std::string whole = readFile(file);
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string text = whole;
        const auto at = text.find(from);
        REQUIRE(at != std::string::npos);
        text.replace(at, from.size(), to);
        std::ofstream(file, std::ios::binary) << text;
    };
    with("\"version\": 1", "\"version\": 2");
    CHECK_THROWS_WITH(readBlockIndex(file), Catch::Contains("blocks.json: version"));
    with("nerfvdb-blocks", "cubes");
    CHECK_THROWS_WITH(readBlockIndex(file), Catch::Contains("blocks.json: format"));
    with("\"up_axis\": 2", "\"up_axis\": 3");
    CHECK_THROWS_WITH(readBlockIndex(file), Catch::Contains("blocks.json: up_axis"));
    with("\"up_axis\": 2", "\"up_axis\": 1.5");
    CHECK_THROWS_AS(readBlockIndex(file), DataError);
    with("\"views\": 5", "\"views\": -5");
    CHECK_THROWS_WITH(readBlockIndex(file), Catch::Contains("models[0].views"));
    with("\"coarsest_voxel_size\": ", "\"coarsest_voxel_size\": -");
    CHECK_THROWS_WITH(readBlockIndex(file), Catch::Contains("coarsest_voxel_size"));
    for (std::size_t n = 0; n < whole.size(); n += 16) {  // truncated
        std::ofstream(file, std::ios::binary) << whole.substr(0, n);
        CHECK_THROWS_AS(readBlockIndex(file), Error);
    }
}
