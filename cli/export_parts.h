// SPDX-License-Identifier: Apache-2.0
// Scenes that leave as several volumes: shells, each in its own voxels, and blocks, which fade into each other.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/json_output.h"
#include "export/vdb_export.h"

namespace nerfvdb {

/// What was written: of the whole scene, or of a part that `id` names.
struct ExportPart {
    Json id;  // {"shell": 1} or {"block": [0, 1]}; empty for the whole
    ExportVdbReport written;
};

/// Each of the inner `n_shells` shells alone: VOLUME.vdb, VOLUME.shell1.vdb, ..., all in one world. One of which nothing is
/// left to write is left out. `options.max_blender_bytes` is for all of them. Throws as exportVdb.
std::vector<ExportPart> exportShells(const Model& model, int n_shells, const std::filesystem::path& out,
                                     ExportVdbOptions options, Report& report);

/// The inner boxes of the blocks of a folder: VOLUME.block0_0.vdb, ..., one in memory at a time; one of which nothing is
/// left is left out. Adds the blocks' cameras to `cameras`, each once. Throws as loadBlock and exportVdb.
std::vector<ExportPart> exportBlocks(const std::filesystem::path& folder, const std::filesystem::path& out,
                                     ExportVdbOptions options, Report& report, std::vector<ModelCamera>& cameras);

}  // namespace nerfvdb
