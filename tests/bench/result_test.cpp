// SPDX-License-Identifier: Apache-2.0
#include "bench/result.h"

#include <cmath>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/bench/made_up_result.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

TEST_CASE("a result survives its JSON: everything that it holds comes back") {
    const BenchResult result = test::madeUpResult();
    TempDir folder;
    writeAtomically(folder / "a.json", jsonText(result));
    const BenchResult back = readResult(folder / "a.json");
    CHECK(jsonText(back) == jsonText(result));
    CHECK(back.kind == "render");
    CHECK(back.facts.cpu == result.facts.cpu);
    CHECK(back.facts.yardstick_s == result.facts.yardstick_s);
    REQUIRE(back.columns.size() == 3);
    CHECK(back.columns[1].better == Better::lower);
    CHECK(back.columns[1].noise == Noise::timed);
    CHECK(back.columns[2].min_difference == 0.05);
    REQUIRE(back.rows.size() == 3);
    CHECK(back.rows[0].cells == result.rows[0].cells);
    CHECK(back.rows[2].cells[2].empty());
    CHECK(back.figures == result.figures);
    CHECK(back.notes == result.notes);
}

TEST_CASE("CSV: medians, intervals where there are repeats, quotes where there must be") {
    CHECK(csvText(test::madeUpResult()) ==
          "series,label,value,seconds,seconds_low,seconds_high,psnr\n"
          "step,\"0,5\",0.5,0.2,0.1,0.4,41.25\n"
          "step,1,1,0.1,0.1,0.1,38.5\n"
          "\"a \"\"b\"\" & <c>\",2,2,0.05,0.04,0.06,\n");
}

TEST_CASE("a table for people: every series, every note, dashes where nothing was measured") {
    const std::string text = tableText(test::madeUpResult());
    for (const char* part : {"Rendering", "seconds [s]", "41.25", "a \"b\" & <c>", "-", "serial share: 0.25",
                             "Note: made up", "Imaginary CPU"}) {
        CAPTURE(part);
        CHECK(text.find(part) != std::string::npos);
    }
}

TEST_CASE("medians by name; a name that is not there is an error") {
    const BenchResult result = test::madeUpResult();
    CHECK(result.median(result.rows[0], "seconds") == 0.2);
    CHECK(std::isnan(result.median(result.rows[2], "psnr")));
    CHECK_THROWS_AS(result.column("speed"), UsageError);
}

TEST_CASE("what is no result is refused with its place") {
    TempDir folder;
    const auto refused = [&](const std::string& text, const std::string& says) {
        CAPTURE(text, says);
        writeAtomically(folder / "bad.json", text);
        try {
            readResult(folder / "bad.json");
            FAIL("it was read");
        } catch (const DataError& error) {
            CHECK(std::string(error.what()).find(says) != std::string::npos);
            CHECK(std::string(error.what()).find("bad.json") != std::string::npos);
        }
    };
    refused("{", "well-formed JSON");
    refused("[1, 2]", "bad.json");
    refused("{\"format\": \"nerfvdb bench 9\"}", "nerfvdb bench 1");
    std::string text = jsonText(test::madeUpResult());
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string changed = text;
        changed.replace(changed.find(from), from.size(), to);
        return changed;
    };
    refused(with("\"better\": \"lower\"", "\"better\": \"faster\""), "columns[1].better");
    refused(with("41.25", "\"high\""), "cells[2][0]");
    refused(with("\"label\": \"1\"", "\"label\": \"0,5\""), "a second row of one series and label: step, 0,5");
    refused(with("\"psnr\"", "\"seconds\""), "a second column of one name: seconds");
    CHECK_THROWS_AS(readResult(folder / "absent.json"), IoError);
}
