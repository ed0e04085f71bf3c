// SPDX-License-Identifier: Apache-2.0
// From a table to a plot of two of its columns, and all three files of a result.
#pragma once

#include <filesystem>
#include <string>

#include "bench/plot.h"
#include "bench/result.h"

namespace nerfvdb {

/// One curve per series of the result, medians with the interval of the repeats in y, labels by row. Title and
/// small print come from the result; axis labels are the columns' names until someone says better.
Plot plotColumns(const BenchResult& result, const std::string& x_column, const std::string& y_column);

/// Marks the Pareto front over all points that the plot shows: low x and high y are good.
void markFront(Plot& plot);

/// Names on the y axis, values along x: a row per label of the result in order of appearance, a marker per
/// series.
Plot plotByLabel(const BenchResult& result, const std::string& x_column);

/// Writes FOLDER/KIND.json, FOLDER/KIND.csv and FOLDER/KIND.svg. Throws IoError.
void writeResult(const BenchResult& result, const Plot& plot, const std::filesystem::path& folder);

}  // namespace nerfvdb
