// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

namespace nerfvdb {

std::string printable(std::string_view text) {
    constexpr char kDigits[] = "0123456789abcdef";
    std::string shown;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte >= 0x20 && byte != 0x7f) shown += c;
        else shown += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
    }
    return shown;
}

Error::Error(const std::string& where, const std::string& found, const std::string& expected,
             const std::string& advice)
    : std::runtime_error(printable(where) + ": found " + printable(found) + ", expected " + expected +
                         (advice.empty() ? std::string() : "; " + advice)) {}

}  // namespace nerfvdb
