// SPDX-License-Identifier: Apache-2.0
#include "bench/stress_row.h"

#include <cmath>
#include <limits>

#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("a row keeps the case that came nearest to its bound, and the largest value") {
    StressRow row("area", "name", "reason");
    CHECK_FALSE(row.passed());  // nothing was tried
    row.add(1, 10, [] { return std::string("near"); });
    row.add(5, 1000, [] { return std::string("large"); });
    CHECK(row.passed());
    CHECK(row.largest == 5);
    CHECK(row.worst == 1);
    CHECK(row.bound == 10);
    CHECK(row.worst_case == "near");
    row.add(10, 10, [] { return std::string("at the bound"); });
    CHECK(row.passed());
    row.add(10.001, 10, [] { return std::string("beyond"); });
    CHECK_FALSE(row.passed());
    CHECK(row.failed == 1);
    CHECK(row.cases == 4);
    CHECK(row.worst_case == "beyond");
}

TEST_CASE("NaN and infinity fail whatever the bound, and so does anything but zero where zero is the bound") {
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        StressRow row("area", "name", "reason");
        row.add(1e300, 1e300, [] { return std::string("large"); });
        row.add(value, 1e308, [] { return std::string("this"); });
        row.add(1, 2);
        CHECK(row.failed == 1);
        CHECK(row.worst_case == "this");
        CHECK_FALSE(std::isfinite(row.largest));
    }
    StressRow row("area", "name", "reason");
    row.add(0, 0);
    CHECK(row.passed());
    row.add(1e-300, 0);
    CHECK_FALSE(row.passed());
}

TEST_CASE("tables name failures and rows that nothing was tried of") {
    StressRow good("one", "kept", "why"), bad("one", "broken", "why"), idle("two", "idle", "why"),
        yes("two", "yes", "why");
    good.add(1e-7, 1e-6);
    bad.add(2, 1, [] { return std::string("the case"); });
    yes.check(true);
    const std::vector<StressRow> rows = {good, bad, idle, yes};
    CHECK_FALSE(allPassed(rows));
    CHECK(allPassed({good, yes}));
    const std::string text = stressText(rows);
    CHECK(text.find("FAILED") != std::string::npos);
    CHECK(text.find("the case") != std::string::npos);
    CHECK(text.find("NOT TRIED") != std::string::npos);
    CHECK(text.find("1e-07") != std::string::npos);
    const std::string markdown = stressMarkdown(rows);
    CHECK(markdown.find("### one") < markdown.find("### two"));
    CHECK(markdown.find("| kept | 1 | 0 | 1e-07 | 1e-07 | 1e-06 | why |") != std::string::npos);
    CHECK(markdown.find("| yes | 1 | 0 | - | - | - | why |") != std::string::npos);
}
