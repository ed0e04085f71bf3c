// SPDX-License-Identifier: Apache-2.0
// A row of the stress table: a promise about numbers, how often it was tried, and the worst that was seen of it
// beside the bound and the bound's reason. As text for a terminal and as Markdown for docs/stability.md.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace nerfvdb {

struct StressRow {
    StressRow(std::string in_area, std::string what, std::string why)
        : area(std::move(in_area)), name(std::move(what)), reason(std::move(why)) {}

    std::string area;    // "ray": which part of the table
    std::string name;    // what is measured, with its unit
    std::string reason;  // why the bound is what it is
    std::uint64_t cases = 0;
    std::uint64_t failed = 0;  // cases beyond their bound
    double largest = 0;        // of all cases; NaN once a case was NaN
    double worst = 0;          // of the case that used most of its bound ...
    double bound = 0;          // ... which was this for that case
    std::string worst_case;    // what that case was

    /// Counts a case. NaN fails, whatever the bound. `describe` is called only for a new worst case.
    void add(double value, double bound_of_case, const std::function<std::string()>& describe = {});
    /// Counts a case that has no figure: it holds, or it does not.
    void check(bool holds, const std::function<std::string()>& describe = {});
    bool passed() const { return failed == 0 && cases > 0; }

private:
    double share_ = -1;  // of its bound that the worst case used
};

bool allPassed(const std::vector<StressRow>& rows);
/// Aligned columns; rows that failed come with their worst case.
std::string stressText(const std::vector<StressRow>& rows);
/// A heading and a table per area.
std::string stressMarkdown(const std::vector<StressRow>& rows);

}  // namespace nerfvdb
