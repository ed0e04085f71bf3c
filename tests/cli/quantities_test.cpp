// SPDX-License-Identifier: Apache-2.0
#include "cli/quantities.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("durations are seconds, minutes or hours", "[cli]") {
    CHECK(parseDuration("--time", "90") == 90);
    CHECK(parseDuration("--time", "90s") == 90);
    CHECK(parseDuration("--time", "5m") == 300);
    CHECK(parseDuration("--time", "1.5h") == 5400);
    for (const char* bad : {"", "m", "5x", "5 m", "0", "-3s", "nan", "inf", "1e400", "5m3"})
        CHECK_THROWS_AS(parseDuration("--time", bad), UsageError);
}

TEST_CASE("sizes are bytes, in powers of 1000 or of 1024", "[cli]") {
    CHECK(parseSize("--max-memory", "1000000") == 1000000);
    CHECK(parseSize("--max-memory", "4GB") == 4000000000u);
    CHECK(parseSize("--max-memory", "4G") == 4000000000u);
    CHECK(parseSize("--max-memory", "512MiB") == 512u << 20);
    CHECK(parseSize("--max-memory", "0.5KiB") == 512);
    for (const char* bad : {"", "GB", "4 GB", "4Gb", "-1GB", "0", "nanGB", "1e30GB"})
        CHECK_THROWS_AS(parseSize("--max-memory", bad), UsageError);
}

TEST_CASE("steps are one number or one per stage", "[cli]") {
    CHECK(parseSteps("--steps", "4000") == std::vector<std::int64_t>{4000});
    CHECK(parseSteps("--steps", "100,400,2000") == std::vector<std::int64_t>{100, 400, 2000});
    for (const char* bad : {"", ",", "10,", ",10", "10;20", "0", "-5", "1.5", "99999999999999999999"})
        CHECK_THROWS_AS(parseSteps("--steps", bad), UsageError);
}

TEST_CASE("a colour is a word or three numbers", "[cli]") {
    CHECK(parseColor("--background", "white") == Vec3f::Ones());
    CHECK(parseColor("--background", "black") == Vec3f::Zero());
    CHECK(parseColor("--background", "0.25,0,1") == Vec3f(0.25f, 0, 1));
    for (const char* bad : {"", "red", "1", "1,0", "1,0,0,0", "1,0,2", "1,0,-0.1", "nan,0,0", "1,0,0 ", "1;0;0"})
        CHECK_THROWS_AS(parseColor("--background", bad), UsageError);
}

TEST_CASE("bounds are two corners", "[cli]") {
    const Box box = parseBounds("--bounds", {-1, -2, -3, 1, 2, 3});
    CHECK(box.min == Vec3d(-1, -2, -3));
    CHECK(box.max == Vec3d(1, 2, 3));
    CHECK_THROWS_AS(parseBounds("--bounds", {0, 0, 0, 1, 1}), UsageError);
    CHECK_THROWS_AS(parseBounds("--bounds", {0, 0, 0, 1, 0, 1}), UsageError);
    CHECK_THROWS_WITH(parseBounds("--bounds", {0, 0, 0, 1, 0, 1}),
                      Catch::Contains("--bounds: found y from 0.0"));
    CHECK_THROWS_AS(parseBounds("--bounds", {0, 0, NAN, 1, 1, 1}), UsageError);
    CHECK_THROWS_AS(parseBounds("--bounds", {0, 0, 0, 1, 1, INFINITY}), UsageError);
}

TEST_CASE("a whole number has 64 bits", "[cli]") {
    std::string text = "18446744073709551615";
    CHECK(wholeNumber()(text).empty());
    for (std::string bad : {"18446744073709551616", "-1", "1.5", "0x10", "", "7 "})
        CHECK_THAT(wholeNumber()(bad), Catch::Contains("expected a whole number from 0 to 18446744073709551615"));
}

TEST_CASE("a refused quantity says where, what and what else", "[cli]") {
    CHECK_THROWS_WITH(parseDuration("--time", "soon"),
                      "--time: found 'soon', expected a duration such as 90, 90s, 5m or 1h");
}
