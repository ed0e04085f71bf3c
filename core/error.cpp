// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

namespace nerfvdb {

Error::Error(const std::string& where, const std::string& found, const std::string& expected,
             const std::string& advice)
    : std::runtime_error(where + ": found " + found + ", expected " + expected +
                         (advice.empty() ? std::string() : "; " + advice)) {}

}  // namespace nerfvdb
