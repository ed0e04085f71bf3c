// SPDX-License-Identifier: Apache-2.0
// A stress result in words and as JSON, as selftest and bench stress tell it.
#pragma once

#include <string>

#include "bench/stress.h"
#include "cli/json_output.h"

namespace nerfvdb {

Json stressJson(const std::string& command, const StressResult& result);
/// The table, and one line that sums it up.
std::string stressSummary(const StressResult& result);
/// Throws NumericError when a row failed, naming the first.
void refuseFailures(const StressResult& result);

}  // namespace nerfvdb
