// SPDX-License-Identifier: Apache-2.0
#include "cli/stress_words.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("a broken promise is an error that names it; kept ones are summed up") {
    StressResult result;
    result.rows.emplace_back("area", "kept", "why");
    result.rows.back().add(1, 2);
    CHECK_NOTHROW(refuseFailures(result));
    CHECK(stressSummary(result).find("1 of 1 promises kept in 1 cases") != std::string::npos);
    CHECK(stressJson("selftest", result).at("passed") == true);

    result.rows.emplace_back("area", "broken", "why");
    result.rows.back().add(3, 2, [] { return std::string("the ray"); });
    CHECK_THROWS_AS(refuseFailures(result), NumericError);
    CHECK_THROWS_WITH(refuseFailures(result),
                      Catch::Matchers::Contains("area: broken") && Catch::Matchers::Contains("the ray"));
    CHECK(stressSummary(result).find("1 of 2 promises kept") != std::string::npos);
    const Json json = stressJson("selftest", result);
    CHECK(json.at("passed") == false);
    CHECK(json.at("rows").at(1).at("failed") == 1);
    CHECK(json.at("rows").at(1).at("bound") == 2.0);

    StressResult idle;
    idle.rows.emplace_back("area", "idle", "why");
    CHECK_THROWS_WITH(refuseFailures(idle), Catch::Matchers::Contains("not tried"));
}
