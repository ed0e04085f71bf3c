// SPDX-License-Identifier: Apache-2.0
#include "cli/stress_words.h"

#include <algorithm>
#include <cmath>

#include "cli/text.h"
#include "core/error.h"

namespace nerfvdb {

Json stressJson(const std::string& command, const StressResult& result) {
    Json json = {{"command", command},        {"passed", allPassed(result.rows)},
                 {"seconds", result.seconds}, {"simd_target", result.facts.simd_target},
                 {"cpu", result.facts.cpu},   {"rows", Json::array()}};
    for (const StressRow& row : result.rows)
        json["rows"].push_back({{"area", row.area},
                                {"name", row.name},
                                {"cases", row.cases},
                                {"failed", row.failed},
                                {"largest", row.largest},  // null for NaN
                                {"worst", row.worst},
                                {"bound", row.bound},
                                {"reason", row.reason},
                                {"worst_case", row.worst_case}});
    return json;
}

std::string stressSummary(const StressResult& result) {
    std::uint64_t cases = 0;
    for (const StressRow& row : result.rows) cases += row.cases;
    const auto kept =
        std::count_if(result.rows.begin(), result.rows.end(), [](const StressRow& r) { return r.passed(); });
    return stressText(result.rows) + formatted("%zu of %zu promises kept in %llu cases, %s\n",
                                               static_cast<std::size_t>(kept), result.rows.size(),
                                               static_cast<unsigned long long>(cases),
                                               durationText(result.seconds).c_str());
}

void refuseFailures(const StressResult& result) {
    for (const StressRow& row : result.rows)
        if (!row.passed())
            throw NumericError(
                row.area + ": " + row.name,
                std::to_string(row.failed) + " of " + std::to_string(row.cases) + " cases beyond their bound",
                "none", "worst: " + (row.worst_case.empty() ? std::string("not tried") : row.worst_case));
}

}  // namespace nerfvdb
