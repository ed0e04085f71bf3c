// SPDX-License-Identifier: Apache-2.0
// Results as bench compare reads them; each is also compared with itself.
#include "bench/result.h"

#include "bench/compare.h"
#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "render.json");
    fuzz::isRead([&] {
        const BenchResult result = readResult(file);
        const ComparisonReport report = compareResults(result, result);
        fuzz::require(report.count(Verdict::better) + report.count(Verdict::worse) == 0, "a result is like itself");
        comparisonText(report);
        tableText(result);
        csvText(result);
        jsonText(result);
    });
    return 0;
}
