// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_row.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace nerfvdb {
namespace {

std::string shortNumber(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2g", value);
    return text;
}

/// A yes-or-no promise has no bound to speak of.
bool hasFigure(const StressRow& row) { return row.bound > 0 || row.worst > 0 || std::isnan(row.worst); }

std::string largestText(const StressRow& row) { return hasFigure(row) ? shortNumber(row.largest) : "-"; }
std::string worstText(const StressRow& row) { return hasFigure(row) ? shortNumber(row.worst) : "-"; }
std::string boundText(const StressRow& row) { return hasFigure(row) ? shortNumber(row.bound) : "-"; }

}  // namespace

void StressRow::add(double value, double bound_of_case, const std::function<std::string()>& describe) {
    ++cases;
    const bool fails = !(value <= bound_of_case);
    failed += fails;
    if (!std::isnan(largest) && !(value <= largest)) largest = value;
    double share = 0;
    if (fails && !std::isfinite(value))
        share = std::numeric_limits<double>::infinity();
    else if (value > 0)
        share = bound_of_case > 0 ? value / bound_of_case : std::numeric_limits<double>::infinity();
    if (share <= share_) return;
    share_ = share;
    worst = value, bound = bound_of_case;
    if (describe) worst_case = describe();
}

void StressRow::check(bool holds, const std::function<std::string()>& describe) {
    ++cases;
    if (holds) return;
    if (failed++ == 0 && describe) worst_case = describe();
}

bool allPassed(const std::vector<StressRow>& rows) {
    return std::all_of(rows.begin(), rows.end(), [](const StressRow& row) { return row.passed(); });
}

std::string stressText(const std::vector<StressRow>& rows) {
    std::size_t name_width = 4;
    for (const StressRow& row : rows) name_width = std::max(name_width, row.area.size() + 2 + row.name.size());
    const auto line = [&](const std::string& name, const std::string& cases, const std::string& largest,
                          const std::string& worst, const std::string& bound, const std::string& verdict) {
        char text[512];
        std::snprintf(text, sizeof text, "%-*s %10s %9s %9s %9s  %s\n", static_cast<int>(name_width),
                      name.c_str(), cases.c_str(), largest.c_str(), worst.c_str(), bound.c_str(),
                      verdict.c_str());
        return std::string(text);
    };
    std::string text = line("what", "cases", "largest", "nearest", "its bound", "");
    for (const StressRow& row : rows) {
        text += line(row.area + ": " + row.name, std::to_string(row.cases), largestText(row), worstText(row),
                     boundText(row),
                     row.passed()     ? "ok"
                     : row.cases == 0 ? "NOT TRIED"
                                      : "FAILED");
        if (row.failed > 0)
            text += "    " + std::to_string(row.failed) + " beyond the bound; worst: " + row.worst_case + "\n";
    }
    return text;
}

std::string stressMarkdown(const std::vector<StressRow>& rows) {
    std::string text, area;
    for (const StressRow& row : rows) {
        if (row.area != area) {
            area = row.area;
            text += (text.empty() ? "### " : "\n### ") + area +
                    "\n\n| What | Cases | Failed | Largest | Nearest to its bound | That bound | Why "
                    "|\n|---|---|---|---|---|---|---|\n";
        }
        text += "| " + row.name + " | " + std::to_string(row.cases) + " | " + std::to_string(row.failed) +
                " | " + largestText(row) + " | " + worstText(row) + " | " + boundText(row) + " | " +
                row.reason + " |\n";
    }
    return text;
}

}  // namespace nerfvdb
