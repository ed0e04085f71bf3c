// SPDX-License-Identifier: Apache-2.0
#include "core/error.h"

namespace nerfvdb {

std::string printable(std::string_view text) {
    constexpr char kDigits[] = "0123456789abcdef";
    std::string shown;
    const auto at = [&](std::size_t i) { return static_cast<unsigned char>(i < text.size() ? text[i] : 0); };
    const auto write = [&](unsigned char byte) { shown += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]}; };
    for (std::size_t i = 0; i < text.size(); ++i) {
        const bool is_c1 = at(i) == 0xc2 && at(i + 1) >= 0x80 && at(i + 1) < 0xa0;  // two bytes of UTF-8
        if (is_c1) write(at(i)), write(at(++i));
        else if (at(i) < 0x20 || at(i) == 0x7f) write(at(i));
        else shown += text[i];
    }
    return shown;
}

Error::Error(const std::string& where, const std::string& found, const std::string& expected,
             const std::string& advice)
    : std::runtime_error(printable(where) + ": found " + printable(found) + ", expected " + expected +
                         (advice.empty() ? std::string() : "; " + advice)) {}

}  // namespace nerfvdb
