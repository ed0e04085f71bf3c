// SPDX-License-Identifier: Apache-2.0
// Verdicts on made-up runs whose answer is known.
#include "bench/compare.h"

#include <algorithm>

#include "core/error.h"
#include "tests/bench/made_up_result.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// One row with one column of the given values.
BenchResult oneCell(const BenchColumn& column, std::vector<double> values) {
    BenchResult result;
    result.kind = "kernels";
    result.facts = test::madeUpFacts();
    result.columns = {column};
    result.rows = {{"series", "row", {std::move(values)}}};
    return result;
}

Verdict verdictOf(const BenchColumn& column, std::vector<double> before, std::vector<double> after,
                  double slower_machine = 1) {
    BenchResult second = oneCell(column, std::move(after));
    second.facts.yardstick_s *= slower_machine;
    const ComparisonReport report = compareResults(oneCell(column, std::move(before)), second);
    REQUIRE(report.cells.size() == 1);
    return report.cells.front().verdict;
}

}  // namespace

TEST_CASE("times: a change counts when it is large enough and the repeats do not overlap") {
    const BenchColumn seconds = secondsColumn("seconds");
    CHECK(verdictOf(seconds, {1.00, 1.01, 1.02}, {1.20, 1.21, 1.22}) == Verdict::worse);
    CHECK(verdictOf(seconds, {1.20, 1.21, 1.22}, {1.00, 1.01, 1.02}) == Verdict::better);
    CHECK(verdictOf(seconds, {1.00, 1.01, 1.02}, {1.01, 1.02, 1.03}) == Verdict::same);     // 1 %: nobody minds
    CHECK(verdictOf(seconds, {1.00, 1.10, 1.30}, {1.05, 1.20, 1.40}) == Verdict::unclear);  // overlap
    CHECK(verdictOf(seconds, {1.00, 1.01}, {1.20, 1.21}) == Verdict::unclear);              // too few
    CHECK(verdictOf(seconds, {1}, {2}) == Verdict::unclear);
}

TEST_CASE("a slower machine is no regression, a still slower program is one") {
    const BenchColumn seconds = secondsColumn("seconds");
    CHECK(verdictOf(seconds, {1.00, 1.01, 1.02}, {1.20, 1.21, 1.22}, 1.25) == Verdict::same);
    CHECK(verdictOf(seconds, {1.00, 1.01, 1.02}, {1.40, 1.41, 1.42}, 1.25) == Verdict::worse);
    CHECK(verdictOf(seconds, {1.00, 1.01, 1.02}, {0.85, 0.86, 0.87}, 0.8) == Verdict::same);
    // What does not depend on the clock is not excused by it.
    const BenchColumn noisy{"speedup", "", Better::higher, Noise::noisy, 0.03, 0};
    CHECK(verdictOf(noisy, {2.00, 2.01, 2.02}, {1.80, 1.81, 1.82}, 1.25) == Verdict::worse);
}

TEST_CASE("exact figures need no repeats; decibels count by difference, and more is better") {
    const BenchColumn psnr = decibelColumn("psnr");
    CHECK(verdictOf(psnr, {30.00}, {29.90}) == Verdict::worse);
    CHECK(verdictOf(psnr, {30.00}, {30.10}) == Verdict::better);
    CHECK(verdictOf(psnr, {30.00}, {29.96}) == Verdict::same);
    CHECK(verdictOf(psnr, {30.00}, {29.95}) == Verdict::same);  // exactly what does not matter yet
    const BenchColumn samples{"samples", "", Better::lower, Noise::exact, 0.01, 0};
    CHECK(verdictOf(samples, {100}, {102}) == Verdict::worse);
    CHECK(verdictOf(samples, {100}, {100.5}) == Verdict::same);
}

TEST_CASE("the noise of repeats is not told as a change: same distribution, a hundred pairs") {
    // Uniform noise of +-10 %, seven repeats: medians often differ by more than 3 %, intervals hardly ever
    // part.
    std::uint64_t state = 7;
    const auto run = [&] {
        std::vector<double> values(7);
        for (double& value : values) {
            state = state * 6364136223846793005ull + 1442695040888963407ull;
            value = 0.9 + 0.2 * static_cast<double>(state >> 33) * 0x1p-31;
        }
        return values;
    };
    int told = 0, unclear = 0;
    for (int pair = 0; pair < 100; ++pair) {
        const Verdict verdict = verdictOf(secondsColumn("seconds"), run(), run());
        told += verdict == Verdict::worse || verdict == Verdict::better;
        unclear += verdict == Verdict::unclear;
    }
    CHECK(told == 0);     // disjoint ranges of seven: 2 / C(14, 7) = 6e-4 a pair
    CHECK(unclear > 10);  // it is the intervals, not the threshold, that keep it quiet
}

TEST_CASE("what has no direction is not compared; cells without values are not either") {
    const ComparisonReport none = compareResults(oneCell({"value"}, {1}), oneCell({"value"}, {2}));
    CHECK(none.cells.empty());
    CHECK(
        compareResults(oneCell(decibelColumn("psnr"), {}), oneCell(decibelColumn("psnr"), {20})).cells.empty());
}

TEST_CASE("rows are matched by name; missing ones and another machine are warnings, not regressions") {
    BenchResult before = test::madeUpResult(), after = test::madeUpResult();
    std::reverse(after.rows.begin(), after.rows.end());
    CHECK(compareResults(before, after).count(Verdict::same) == 5);
    CHECK(compareResults(before, after).warnings.empty());

    after.rows.pop_back();
    after.facts.cpu = "Another CPU";
    after.facts.threads = 4;
    const ComparisonReport report = compareResults(before, after);
    CHECK(report.cells.size() == 3);
    CHECK(report.count(Verdict::worse) == 0);
    REQUIRE(report.warnings.size() == 3);
    const std::string text = comparisonText(report);
    for (const char* part : {"Another CPU", "number of threads", "only in the first: step, 0,5", "0 worse"}) {
        CAPTURE(part);
        CHECK(text.find(part) != std::string::npos);
    }
}

TEST_CASE("a regression is told with both medians and intervals") {
    const std::string text = comparisonText(compareResults(oneCell(secondsColumn("seconds"), {1.0, 1.1, 1.2}),
                                                           oneCell(secondsColumn("seconds"), {2, 3, 4})));
    CHECK(text.find("worse: series, row, seconds: 1.1 (1 to 1.2), then 3 (2 to 4) s") != std::string::npos);
    CHECK(text.find("1 worse") != std::string::npos);
}

TEST_CASE("two kinds, or nothing in common, cannot be compared") {
    BenchResult a = oneCell({"value"}, {1}), b = a;
    b.kind = "render";
    CHECK_THROWS_AS(compareResults(a, b), DataError);
    b = a;
    b.rows[0].label = "another";
    CHECK_THROWS_AS(compareResults(a, b), DataError);
}
