// SPDX-License-Identifier: Apache-2.0
#include "cli/text.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace nerfvdb {

std::string formatted(const char* pattern, ...) {
    va_list arguments, again;
    va_start(arguments, pattern);
    va_copy(again, arguments);
    const int length = std::vsnprintf(nullptr, 0, pattern, arguments);
    va_end(arguments);
    std::string text(length > 0 ? static_cast<std::size_t>(length) : 0, '\0');
    std::vsnprintf(text.data(), text.size() + 1, pattern, again);
    va_end(again);
    return text;
}

std::string durationText(double seconds) {
    if (seconds < 9.95) return formatted("%.1f s", seconds);
    if (seconds < 59.5) return formatted("%.0f s", seconds);
    const long long whole = std::llround(seconds);
    if (whole < 3600) return formatted("%lld:%02lld", whole / 60, whole % 60);
    return formatted("%lld:%02lld:%02lld", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string sizeText(double bytes) {
    const char* const units[] = {"B", "kB", "MB", "GB", "TB"};
    int unit = 0;
    while (bytes >= 999.5 && unit < 4) {
        bytes /= 1000;
        ++unit;
    }
    return formatted(unit > 0 && bytes < 9.95 ? "%.1f %s" : "%.0f %s", bytes, units[unit]);
}

}  // namespace nerfvdb
