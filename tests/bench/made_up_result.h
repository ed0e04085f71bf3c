// SPDX-License-Identifier: Apache-2.0
// A result that nobody measured, with everything that can be awkward in one.
#pragma once

#include "bench/result.h"

namespace nerfvdb::test {

inline RunFacts madeUpFacts() {
    RunFacts facts;
    facts.version = "0.1.0";
    facts.commit = "abc1234";
    facts.compiler = "gnu 12.2.0 Release";
    facts.cpu = "Imaginary CPU";
    facts.cores = 8;
    facts.threads = 2;
    facts.simd_target = "AVX9";
    facts.date = "2030-01-02T03:04:05Z";
    facts.load = 0.25;
    facts.yardstick_s = 0.01;
    return facts;
}

/// Three rows in two series: repeats, a single value, a cell that was not measured, and names that need
/// escapes.
inline BenchResult madeUpResult() {
    BenchResult result;
    result.kind = "render";
    result.title = "Rendering <nothing> & more";
    result.facts = madeUpFacts();
    result.columns = {{"value"}, secondsColumn("seconds"), decibelColumn("psnr")};
    result.rows = {{"step", "0,5", {{0.5}, {0.2, 0.1, 0.4}, {41.25}}},
                   {"step", "1", {{1}, {0.1}, {38.5}}},
                   {"a \"b\" & <c>", "2", {{2}, {0.04, 0.05, 0.06}, {}}}};
    result.figures = {{"serial share", 0.25}};
    result.notes = {"made up"};
    return result;
}

}  // namespace nerfvdb::test
