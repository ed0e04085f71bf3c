// SPDX-License-Identifier: Apache-2.0
#include "cli/block_words.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("blocks are columns by rows", "[cli]") {
    CHECK(parseBlockCount("--blocks", "3x2").columns == 3);
    CHECK(parseBlockCount("--blocks", "3x2").rows == 2);
    for (const char* bad : {"", "3", "x2", "3x", "3x2x1", "0x1", "1x257", "-1x2", "3X2", "3 x 2", "1.5x2", "99999999999x1"})
        CHECK_THROWS_AS(parseBlockCount("--blocks", bad), UsageError);
}

TEST_CASE("a block is a column and a row, from 0 on", "[cli]") {
    CHECK(parseBlock("--block", "0,1") == BlockId{0, 1});
    for (const char* bad : {"", "0", "0,", ",1", "-1,0", "0,1,2", "0x1", "a,b"})
        CHECK_THROWS_AS(parseBlock("--block", bad), UsageError);
}
