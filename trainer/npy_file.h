// SPDX-License-Identifier: Apache-2.0
// Matrices as numpy saves them. Source: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

namespace nerfvdb {

struct NpyMatrix {
    std::size_t rows = 0, columns = 0;
    std::vector<double> values;  // row by row
    double at(std::size_t row, std::size_t column) const { return values[row * columns + column]; }
};

/// Reads a .npy of version 1, 2 or 3 that holds two dimensions of little-endian float32 or float64, in C's or Fortran's
/// order. Throws IoError, or DataError: another kind of array, a header that is not understood, too few or too many
/// bytes. Values may be NaN.
NpyMatrix readNpyMatrix(const std::filesystem::path& file);

}  // namespace nerfvdb
