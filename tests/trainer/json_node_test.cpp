// SPDX-License-Identifier: Apache-2.0
#include "trainer/json_node.h"

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Contains;

TEST_CASE("a JSON file that does not parse is named with line and column", "[trainer]") {
    const TempDir dir;
    writeAtomically(dir / "a.json", "{\n \"frames\": [1, 2,,]\n}");
    CHECK_THROWS_AS(parseJsonFile(dir / "a.json"), DataError);
    CHECK_THROWS_WITH(parseJsonFile(dir / "a.json"), Contains("a.json") && Contains("line 2, column 18"));
    writeAtomically(dir / "a.json", "");
    CHECK_THROWS_AS(parseJsonFile(dir / "a.json"), DataError);
    CHECK_THROWS_AS(parseJsonFile(dir / "absent.json"), IoError);
}

TEST_CASE("a number beyond every double is an error that names the file and the number", "[trainer]") {
    const TempDir dir;
    writeAtomically(dir / "a.json", R"({"w": 1e400})");
    CHECK_THROWS_AS(parseJsonFile(dir / "a.json"), DataError);
    CHECK_THROWS_WITH(parseJsonFile(dir / "a.json"), Contains("a.json: found") && Contains("1e400"));
}

TEST_CASE("NaN and Infinity outside strings are found where they are read", "[trainer]") {
    const TempDir dir;
    writeAtomically(dir / "a.json",
                    R"({"a": [1, NaN], "b": -Infinity, "Infinity \" NaN": "NaN \\", "c": Infinity})");
    const nlohmann::json json = parseJsonFile(dir / "a.json");
    const JsonNode document(json, "a.json");
    CHECK(document.at("a").element(0).number() == 1);
    CHECK_THROWS_WITH(document.at("a").element(1).number(),
                      "a.json: a[1]: found \"NaN\", expected a finite number");
    CHECK_THROWS_WITH(document.at("b").number(), Contains("b: found \"-Infinity\""));
    CHECK_THROWS_WITH(document.at("c").number(), Contains("c: found \"Infinity\""));
    CHECK(document.at("Infinity \" NaN").text() == "NaN \\");
}

TEST_CASE("every access names the field, what was found and what was expected", "[trainer]") {
    const nlohmann::json json = {{"list", {1, {{"name", 5}}, -2.5, nullptr, 1e300 * 10}}, {"yes", true}};
    const JsonNode document(json, "f.json");
    const JsonNode list = document.at("list");
    CHECK_THROWS_WITH(document.at("none"), "f.json: found no key 'none', expected one");
    CHECK_THROWS_WITH(list.element(7), Contains("f.json: list: found 5 elements"));
    CHECK_THROWS_WITH(list.element(1).at("name").text(), "f.json: list[1].name: found 5, expected a text");
    CHECK_THROWS_WITH(list.element(2).positiveNumber(),
                      Contains("list[2]: found -2.5, expected a number above zero"));
    CHECK_THROWS_WITH(list.element(3).number(), Contains("list[3]: found null"));
    CHECK_THROWS_WITH(list.number(), Contains("found an array of 5"));
    CHECK_THROWS_WITH(list.element(0).at("x"),
                      Contains("list[0]: found 1, expected an object with the key 'x'"));
    CHECK_THROWS_WITH(document.arraySize(), Contains("found an object, expected an array"));
    CHECK(document.at("yes").isTrue());
    CHECK_FALSE(list.has("x"));
}
