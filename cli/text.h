// SPDX-License-Identifier: Apache-2.0
// Numbers as people read them.
#pragma once

#include <string>

namespace nerfvdb {

/// printf into a string.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* pattern, ...);

/// "0.4 s", "12 s", "4:07", "1:02:03".
std::string durationText(double seconds);

/// "3.4 GB", "512 kB": powers of 1000.
std::string sizeText(double bytes);

}  // namespace nerfvdb
