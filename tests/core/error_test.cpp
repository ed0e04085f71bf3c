// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("an error shows what files say without doing it", "[core]") {
    const DataError error("a\x1b[2J.png", std::string("'x\0\n\x7f'", 6), "a \xc3\xa4");
    CHECK(error.what() == std::string("a\\x1b[2J.png: found 'x\\x00\\x0a\\x7f', expected a \xc3\xa4"));
}

TEST_CASE("control characters are written out, and nothing else", "[core]") {
    CHECK(printable("plain text, 'quoted' \\ ~") == "plain text, 'quoted' \\ ~");
    CHECK(printable("\xc3\xa4 \xe2\x82\xac \xc2\xa0") == "\xc3\xa4 \xe2\x82\xac \xc2\xa0");  // what is not ASCII stays
    CHECK(printable("\xc2\x9b" "31m") == "\\xc2\\x9b31m");  // the same as \x1b[ to some terminals
    CHECK(printable("\xc2") == "\xc2");
    CHECK(printable("\t\r") == "\\x09\\x0d");
    CHECK(printable("").empty());
}
