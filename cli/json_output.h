// SPDX-License-Identifier: Apache-2.0
// Results for other programs: one JSON object per command, with keys that stay as they are.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace nerfvdb {

using Json = nlohmann::ordered_json;  // keys leave in the order in which they were set

/// Throws IoError if the target of --json cannot be written; "" and "-" always can. Call it before long work.
void checkJsonTarget(const std::string& target);

/// Writes to a file ("-": standard output; "": nowhere).
void writeJson(const std::string& target, const Json& json);

}  // namespace nerfvdb
