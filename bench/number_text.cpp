// SPDX-License-Identifier: Apache-2.0
#include "bench/number_text.h"

#include <charconv>
#include <cmath>
#include <cstdio>

namespace nerfvdb {
namespace {

std::string general(double value, int digits) {
    char text[40];
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    return text;
}

}  // namespace

std::string numberText(double value) {
    if (!std::isfinite(value)) return std::isnan(value) ? "nan" : value < 0 ? "-inf" : "inf";
    const double size = std::abs(value);
    if (size == 0 || (size >= 1e-4 && size < 1e4)) return general(value, 4);
    if (size >= 1e4 && size < 1e15) return general(std::nearbyint(value), 15);
    return general(value, 4);
}

std::string tickText(double value) {
    const double size = std::abs(value);
    if (size >= 1e9) return general(value / 1e9, 6) + "G";
    if (size >= 1e6) return general(value / 1e6, 6) + "M";
    if (size >= 1e4) return general(value / 1e3, 6) + "k";
    return general(value, 6);
}

std::string exactText(double value) {
    char text[40];
    const auto [end, error] = std::to_chars(text, text + sizeof text, value);
    return error == std::errc() ? std::string(text, end) : general(value, 17);
}

}  // namespace nerfvdb
