// SPDX-License-Identifier: Apache-2.0
#include "cli/quantities.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// Splits "1.5h" into 1.5 and "h"; the number is NaN when there is none.
std::pair<double, std::string> numberAndUnit(const std::string& text) {
    double number = NAN;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc()) return {NAN, text};
    return {number, std::string(rest, text.data() + text.size())};
}

/// Factor of a unit in a table, or 0.
template <std::size_t N>
double unitFactor(const std::string& unit, const std::pair<const char*, double> (&table)[N]) {
    for (const auto& [name, factor] : table)
        if (unit == name) return factor;
    return 0;
}

std::string quoted(const std::string& text) { return "'" + text + "'"; }

}  // namespace

double parseDuration(const std::string& where, const std::string& text) {
    static constexpr std::pair<const char*, double> kUnits[] = {
        {"", 1}, {"s", 1}, {"min", 60}, {"m", 60}, {"h", 3600}};
    const auto [number, unit] = numberAndUnit(text);
    const double seconds = number * unitFactor(unit, kUnits);
    if (!(seconds > 0) || !std::isfinite(seconds))
        throw UsageError(where, quoted(text), "a duration such as 90, 90s, 5m or 1h");
    return seconds;
}

std::size_t parseSize(const std::string& where, const std::string& text) {
    static constexpr std::pair<const char*, double> kUnits[] = {
        {"", 1},    {"B", 1},   {"kB", 1e3},     {"KB", 1e3},     {"MB", 1e6},     {"GB", 1e9},    {"TB", 1e12},
        {"M", 1e6}, {"G", 1e9}, {"KiB", 0x1p10}, {"MiB", 0x1p20}, {"GiB", 0x1p30}, {"TiB", 0x1p40}};
    const auto [number, unit] = numberAndUnit(text);
    const double bytes = number * unitFactor(unit, kUnits);
    if (!(bytes >= 1) || bytes > 0x1p60) throw UsageError(where, quoted(text), "a size such as 4GB or 512MiB");
    return static_cast<std::size_t>(bytes);
}

std::vector<std::int64_t> parseSteps(const std::string& where, const std::string& text) {
    std::vector<std::int64_t> steps;
    const char* at = text.data();
    const char* const end = text.data() + text.size();
    while (true) {
        std::int64_t value = 0;
        const auto [rest, error] = std::from_chars(at, end, value);
        if (error != std::errc() || value <= 0 || (rest != end && *rest != ','))
            throw UsageError(where, quoted(text), "positive numbers of steps such as 4000 or 100,400,2000");
        steps.push_back(value);
        if (rest == end) return steps;
        at = rest + 1;
    }
}

Vec3f parseColor(const std::string& where, const std::string& text) {
    if (text == "white") return Vec3f::Ones();
    if (text == "black") return Vec3f::Zero();
    Vec3f color;
    const char* at = text.data();
    const char* const end = text.data() + text.size();
    for (int c = 0; c < 3; ++c) {
        const auto [rest, error] = std::from_chars(at, end, color[c]);
        const bool is_last = c == 2;
        if (error != std::errc() || !(color[c] >= 0 && color[c] <= 1) || (is_last ? rest != end : *rest != ','))
            throw UsageError(where, quoted(text), "white, black or three numbers from 0 to 1 such as 0.2,0.4,1");
        at = rest + 1;
    }
    return color;
}

Box parseBounds(const std::string& where, const std::vector<double>& numbers) {
    const std::string expected = "six numbers x0 y0 z0 x1 y1 z1 with x0 < x1, y0 < y1, z0 < z1";
    if (numbers.size() != 6) throw UsageError(where, std::to_string(numbers.size()) + " numbers", expected);
    const Box box{{numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]}};
    for (int axis = 0; axis < 3; ++axis) {
        const double size = box.size()[axis];
        if (!(size > 0) || !std::isfinite(size))
            throw UsageError(where,
                             std::string(1, "xyz"[axis]) + " from " + std::to_string(box.min[axis]) + " to " +
                                 std::to_string(box.max[axis]),
                             expected);
    }
    return box;
}

CLI::Validator wholeNumber() {
    const auto check = [](const std::string& text) {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        return error == std::errc() && end == text.data() + text.size()
                   ? std::string()
                   : "found '" + text + "', expected a whole number from 0 to 18446744073709551615";
    };
    return CLI::Validator(check, "");
}

CLI::Validator positive() {
    const auto check = [](const std::string& text) {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && value > 0 && std::isfinite(value) ? std::string() : "found '" + text + "', expected a number above 0";
    };
    return CLI::Validator(check, "");
}

}  // namespace nerfvdb
