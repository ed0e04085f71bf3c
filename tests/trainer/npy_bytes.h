// SPDX-License-Identifier: Apache-2.0
// Matrices as numpy would save them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "tests/support/temp_dir.h"

namespace nerfvdb::testing {

inline std::string npyHead(const std::string& dict, int version) {
    const std::string padded = dict + std::string(20, ' ') + "\n";
    const auto length = static_cast<std::uint32_t>(padded.size());
    std::string out = "\x93NUMPY";
    out += static_cast<char>(version);
    out += '\0';
    out.append(reinterpret_cast<const char*>(&length), version == 1 ? 2 : 4);
    return out + padded;
}

/// The values in the order in which they lie in the file.
inline std::string npyBytes(const std::vector<double>& values, std::size_t rows, std::size_t columns, int version = 1,
                            bool is_fortran = false, bool is_double = true) {
    std::string out = npyHead("{'descr': '" + std::string(is_double ? "<f8" : "<f4") + "', 'fortran_order': " +
                                  (is_fortran ? "True" : "False") + ", 'shape': (" + std::to_string(rows) + ", " +
                                  std::to_string(columns) + "), }",
                              version);
    for (const double value : values) {
        const auto single = static_cast<float>(value);
        if (is_double) out.append(reinterpret_cast<const char*>(&value), sizeof value);
        if (!is_double) out.append(reinterpret_cast<const char*>(&single), sizeof single);
    }
    return out;
}

}  // namespace nerfvdb::testing
