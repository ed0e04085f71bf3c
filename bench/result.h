// SPDX-License-Identifier: Apache-2.0
// What a benchmark found: a table in which every cell keeps all of its repeats, so that a later comparison can
// tell a change from noise, and the facts that the figures depend on. As JSON for programs, CSV for
// spreadsheets, text for a terminal.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "bench/machine.h"

namespace nerfvdb {

enum class Better { neither, lower, higher };
/// exact: the same at every repeat. noisy: differs from repeat to repeat. timed: and slows down with the
/// machine.
enum class Noise { exact, noisy, timed };

/// What a column holds, and which change of it would matter to somebody.
struct BenchColumn {
    std::string name;       // a key for programs: lower case, no spaces
    std::string unit = {};  // "s", "dB", "" for plain numbers
    Better better = Better::neither;
    Noise noise = Noise::exact;
    double min_share = 0;       // a smaller change than this share of the value does not matter ...
    double min_difference = 0;  // ... nor a smaller one than this, in the column's unit
};

/// Column kinds that most benchmarks share.
BenchColumn secondsColumn(const std::string& name);  // timed, lower is better, 3 % matter
BenchColumn decibelColumn(const std::string& name);  // exact, higher is better, 0.05 dB matter

struct BenchRow {
    std::string series;                      // the curve that it belongs to
    std::string label;                       // its name there; (series, label) is unique
    std::vector<std::vector<double>> cells;  // [column][repeat]; no repeats: not measured
};

struct BenchResult {
    std::string kind;   // "render": what was measured
    std::string title;  // for a person, with the scene
    RunFacts facts;
    std::vector<BenchColumn> columns;
    std::vector<BenchRow> rows;
    std::vector<std::pair<std::string, double>> figures;  // conclusions, such as a serial share
    std::vector<std::string> notes;                       // what a reader must know

    /// Number of a column; throws UsageError when there is none of this name.
    std::size_t column(const std::string& name) const;
    /// Median of a cell, NaN when it was not measured.
    double median(const BenchRow& row, const std::string& column_name) const;
};

std::string jsonText(const BenchResult& result);
std::string csvText(const BenchResult& result);    // median per cell, and low and high where there are repeats
std::string tableText(const BenchResult& result);  // aligned columns of medians, figures and notes

/// Reads what jsonText wrote. Throws IoError, or DataError naming file and field.
BenchResult readResult(const std::filesystem::path& path);

}  // namespace nerfvdb
