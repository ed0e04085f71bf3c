// SPDX-License-Identifier: Apache-2.0
// Quantities as people type them: durations, sizes of memory, lists of steps, colours, boxes.
// `where` is the option's name, for the message of the UsageError.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

/// "90", "90s", "5m", "1.5h" -> seconds, positive.
double parseDuration(const std::string& where, const std::string& text);

/// "512MiB", "4GB", "4G" (powers of 1000 without the i), "1000000" -> bytes, positive.
std::size_t parseSize(const std::string& where, const std::string& text);

/// "4000" or "100,400,2000" -> positive whole numbers.
std::vector<std::int64_t> parseSteps(const std::string& where, const std::string& text);

/// "white", "black" or "0.2,0.4,1" -> sRGB values in [0, 1].
Vec3f parseColor(const std::string& where, const std::string& text);

/// {x0, y0, z0, x1, y1, z1} -> a box with positive size.
Box parseBounds(const std::string& where, const std::vector<double>& numbers);

/// For options that take a whole number, which CLI11 cuts to 64 bits without a word.
CLI::Validator wholeNumber();

/// For options that take a number above 0; CLI11's own says the bounds of a double in 600 digits.
CLI::Validator positive();

}  // namespace nerfvdb
