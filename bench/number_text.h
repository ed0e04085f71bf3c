// SPDX-License-Identifier: Apache-2.0
// Numbers in tables and on axes.
#pragma once

#include <string>

namespace nerfvdb {

/// Four digits that count, without an exponent where people would not write one: "0.0312", "31.25", "152300".
std::string numberText(double value);

/// Short, for an axis: "0.05", "20", "150k", "1.5M".
std::string tickText(double value);

/// Every digit that a double has, no more than it needs: reads back as the same number.
std::string exactText(double value);

}  // namespace nerfvdb
