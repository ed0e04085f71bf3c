// SPDX-License-Identifier: Apache-2.0
// What 'nerfvdb mesh' does to a surface after it was found: islands go, it is smoothed, it is simplified.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>

#include "core/report.h"
#include "export/mesh_cleanup.h"

namespace nerfvdb {

struct ReworkWords {
    std::optional<double> min_share;
    std::size_t keep_largest = 0, min_faces = 0;
    bool keep_islands = false;
    int smooth = 0;
    std::optional<double> simplify;
    std::optional<std::int64_t> faces;
};

void addRework(CLI::App& app, ReworkWords& words);

/// Throws NumericError for a number of faces that no mesh can have, UsageError for a share of none.
void checkRework(const ReworkWords& words);

/// Whether any word says what is to be done; dropping crumbs goes without.
bool asksForWork(const ReworkWords& words);

/// Islands, smoothing, simplification, in this order; colours are not looked at. What simplification leaves in more pieces
/// than may stay is looked through once more. Returns what went as islands.
IslandCounts reworkMesh(Mesh& mesh, const ReworkWords& words, Report& report);

}  // namespace nerfvdb
