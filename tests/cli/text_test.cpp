// SPDX-License-Identifier: Apache-2.0
#include "cli/text.h"

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("durations read as a clock from a minute on", "[cli]") {
    CHECK(durationText(0.04) == "0.0 s");
    CHECK(durationText(9.94) == "9.9 s");
    CHECK(durationText(9.96) == "10 s");
    CHECK(durationText(59.6) == "1:00");
    CHECK(durationText(247) == "4:07");
    CHECK(durationText(3723) == "1:02:03");
}

TEST_CASE("sizes keep two or three digits", "[cli]") {
    CHECK(sizeText(0) == "0 B");
    CHECK(sizeText(999) == "999 B");
    CHECK(sizeText(999.6) == "1.0 kB");
    CHECK(sizeText(3.44e9) == "3.4 GB");
    CHECK(sizeText(25e6) == "25 MB");
}

TEST_CASE("formatted text may be of any length", "[cli]") {
    const std::string word(5000, 'x');
    CHECK(formatted("%s-%d", word.c_str(), 7) == word + "-7");
}
