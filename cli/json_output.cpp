// SPDX-License-Identifier: Apache-2.0
#include "cli/json_output.h"

#include <iostream>

#include "cli/output_path.h"
#include "core/atomic_file.h"

namespace nerfvdb {

void checkJsonTarget(const std::string& target) {
    if (!target.empty() && target != "-") prepareOutputFile("--json", target);
}

void writeJson(const std::string& target, const Json& json) {
    if (target.empty()) return;
    // Bytes of a path that are no UTF-8 are replaced rather than refused: results must not be lost to a name.
    const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
    if (target == "-") {
        std::cout << text;
        return;
    }
    writeAtomically(target, text);
}

}  // namespace nerfvdb
