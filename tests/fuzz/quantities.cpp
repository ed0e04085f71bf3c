// SPDX-License-Identifier: Apache-2.0
// Words of options: the same text as each of them.
#include "cli/quantities.h"

#include <cmath>
#include <sstream>

#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text(fuzz::textOf(data, size));
    fuzz::isRead([&] { fuzz::require(parseDuration("--time", text) > 0, "durations are positive"); });
    fuzz::isRead([&] { fuzz::require(parseSize("--max-memory", text) >= 1, "sizes are positive"); });
    fuzz::isRead([&] {
        for (const std::int64_t step : parseSteps("--save-steps", text)) fuzz::require(step > 0, "steps are positive");
    });
    fuzz::isRead([&] { fuzz::require(parseColor("--background", text).allFinite(), "colours are finite"); });
    std::istringstream words(text);
    std::vector<double> numbers;
    for (double number; numbers.size() < 7 && words >> number;) numbers.push_back(number);
    fuzz::isRead([&] { fuzz::require(parseBounds("--bounds", numbers).size().minCoeff() > 0, "boxes have a size"); });
    return 0;
}
