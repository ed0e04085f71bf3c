// SPDX-License-Identifier: Apache-2.0
// Two results of one benchmark, before and after: what became better or worse, and what is only noise.
#pragma once

#include <string>
#include <vector>

#include "bench/repeat.h"
#include "bench/result.h"

namespace nerfvdb {

enum class Verdict {
    same,     // no change that would matter
    better,   // changed by more than matters, and the repeats do not overlap
    worse,    // the same the other way
    unclear,  // the medians say so, but repeats overlap, are too few, or the machine itself changed as much
};

/// One cell that both results have. Columns that are neither better high nor low are not compared.
struct Comparison {
    std::string series, label, column, unit;
    Summary before, after;
    double change =
        0;  // after - before, as a share of before; in the column's unit where it counts in differences
    Verdict verdict = Verdict::same;
};

struct ComparisonReport {
    std::vector<Comparison> cells;
    std::vector<std::string> warnings;  // what differs about machine, program or rows
    double drift = 0;                   // share by which the machine's yardstick changed

    int count(Verdict verdict) const;
};

/// A cell changed if |after - before| > max(min_share * |before|, min_difference) of its column; a timed
/// column's min_share grows by `drift`, because a machine that slowed down is no regression. The change is told
/// as better or worse if the repeats bear it out: for exact columns always; else both sides need three repeats
/// and their intervals (repeat.h) must not overlap. Throws DataError if the results are of two kinds or share
/// no row.
ComparisonReport compareResults(const BenchResult& before, const BenchResult& after);

/// "same", "better", "worse", "unclear".
const char* verdictName(Verdict verdict);

/// For a terminal: every change, then counts and warnings.
std::string comparisonText(const ComparisonReport& report);

}  // namespace nerfvdb
