// SPDX-License-Identifier: Apache-2.0
#include "bench/compare.h"

#include <algorithm>
#include <cmath>

#include "bench/number_text.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr int kFewestRepeats = 3;
constexpr double kDriftWorthTelling = 0.05;

const BenchRow* findRow(const BenchResult& result, const BenchRow& like) {
    for (const BenchRow& row : result.rows)
        if (row.series == like.series && row.label == like.label) return &row;
    return nullptr;
}

int findColumn(const BenchResult& result, const std::string& name) {
    for (std::size_t c = 0; c < result.columns.size(); ++c)
        if (result.columns[c].name == name) return static_cast<int>(c);
    return -1;
}

Verdict judge(const BenchColumn& column, const Summary& before, const Summary& after, double drift) {
    const double share = column.min_share + (column.noise == Noise::timed ? drift : 0.0);
    const double difference = after.median - before.median;
    // Rounding: a change that is exactly as large as what matters does not matter yet.
    const double least = std::max(share * std::abs(before.median), column.min_difference) * (1 + 1e-9);
    if (!(std::abs(difference) > least)) return Verdict::same;
    if (column.noise != Noise::exact) {
        const bool is_enough = std::min(before.n, after.n) >= kFewestRepeats;
        const bool is_apart = before.high < after.low || after.high < before.low;
        if (!is_enough || !is_apart) return Verdict::unclear;
    }
    return (difference > 0) == (column.better == Better::higher) ? Verdict::better : Verdict::worse;
}

void warnAboutFacts(const RunFacts& before, const RunFacts& after, ComparisonReport& report) {
    const auto differ = [&](const char* what, const std::string& a, const std::string& b) {
        if (a != b) report.warnings.push_back(std::string(what) + " differs: " + a + ", then " + b);
    };
    differ("the processor", before.cpu, after.cpu);
    differ("the number of threads", std::to_string(before.threads), std::to_string(after.threads));
    differ("the instruction set", before.simd_target, after.simd_target);
    differ("the compiler", before.compiler, after.compiler);
    if (report.drift > kDriftWorthTelling)
        report.warnings.push_back("the machine itself changed by " + numberText(100 * report.drift) +
                                  " % between the runs; times count only beyond that");
}

}  // namespace

int ComparisonReport::count(Verdict verdict) const {
    return static_cast<int>(std::count_if(cells.begin(), cells.end(),
                                          [&](const Comparison& cell) { return cell.verdict == verdict; }));
}

ComparisonReport compareResults(const BenchResult& before, const BenchResult& after) {
    if (before.kind != after.kind)
        throw DataError("bench compare", "a result of '" + before.kind + "' and one of '" + after.kind + "'",
                        "two results of one kind");
    ComparisonReport report;
    const double a = before.facts.yardstick_s, b = after.facts.yardstick_s;
    if (a > 0 && b > 0) report.drift = std::max(a, b) / std::min(a, b) - 1;
    warnAboutFacts(before.facts, after.facts, report);

    std::size_t n_shared = 0;
    for (const BenchRow& row : before.rows) {
        const BenchRow* const other = findRow(after, row);
        if (!other) {
            report.warnings.push_back("only in the first: " + row.series + ", " + row.label);
            continue;
        }
        ++n_shared;
        for (std::size_t c = 0; c < before.columns.size(); ++c) {
            const BenchColumn& column = before.columns[c];
            const int other_column = findColumn(after, column.name);
            if (column.better == Better::neither || other_column < 0) continue;
            Comparison cell{row.series,
                            row.label,
                            column.name,
                            column.unit,
                            summarize(row.cells[c]),
                            summarize(other->cells[static_cast<std::size_t>(other_column)])};
            if (cell.before.n == 0 || cell.after.n == 0) continue;
            const double difference = cell.after.median - cell.before.median;
            cell.change = column.min_difference > 0 || cell.before.median == 0
                              ? difference
                              : difference / std::abs(cell.before.median);
            cell.verdict = judge(column, cell.before, cell.after, report.drift);
            report.cells.push_back(cell);
        }
    }
    for (const BenchRow& row : after.rows)
        if (!findRow(before, row))
            report.warnings.push_back("only in the second: " + row.series + ", " + row.label);
    if (n_shared == 0)
        throw DataError("bench compare", "no row that both results have", "two runs of one benchmark");
    return report;
}

const char* verdictName(Verdict verdict) {
    static constexpr const char* kNames[] = {"same", "better", "worse", "unclear"};
    return kNames[static_cast<int>(verdict)];
}

std::string comparisonText(const ComparisonReport& report) {
    const auto summaryText = [](const Summary& summary) {
        std::string text = numberText(summary.median);
        if (summary.n > 1) text += " (" + numberText(summary.low) + " to " + numberText(summary.high) + ")";
        return text;
    };
    std::string text;
    for (const Comparison& cell : report.cells) {
        if (cell.verdict == Verdict::same) continue;
        text += std::string(verdictName(cell.verdict)) + ": " + cell.series + ", " + cell.label + ", " +
                cell.column + ": " + summaryText(cell.before) + ", then " + summaryText(cell.after) +
                (cell.unit.empty() ? "" : " " + cell.unit) + "\n";
    }
    text += std::to_string(report.count(Verdict::worse)) + " worse, " +
            std::to_string(report.count(Verdict::better)) + " better, " +
            std::to_string(report.count(Verdict::unclear)) + " unclear, " +
            std::to_string(report.count(Verdict::same)) + " the same\n";
    for (const std::string& warning : report.warnings) text += "Warning: " + warning + "\n";
    return text;
}

}  // namespace nerfvdb
