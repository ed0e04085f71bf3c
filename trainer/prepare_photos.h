// SPDX-License-Identifier: Apache-2.0
// Photographs whose cameras are unknown -> a data set: the program COLMAP finds features, matches them and places the
// cameras (Schoenberger and Frahm 2016, "Structure-from-motion revisited"). COLMAP is run, not linked.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/report.h"
#include "trainer/capture_plan.h"

namespace nerfvdb {

struct PrepareOptions : CaptureOptions {
    std::string camera_model = "OPENCV";  // COLMAP's name of a lens model
    bool force = false;                   // begin anew: what COLMAP left in the data set is removed
};

/// Wall time of a phase of this call; nothing where an earlier call had done it.
struct PhaseSeconds {
    std::optional<double> features, matching, mapping;
};

struct PreparedPhotos {
    std::size_t photos = 0;
    CapturePlan plan;
    double predicted_matching_seconds = 0;      // from the features that were found; 0 when nothing was left to match
    std::vector<std::string> unregistered;      // names: no camera in the largest model
    std::vector<std::size_t> model_sizes;       // photographs with a camera, of each model, the largest first
    std::size_t points = 0;                     // of the largest
    std::optional<double> reprojection_error;   // of its points, mean, pixels; where COLMAP tells it
    PhaseSeconds seconds;
};

/// Makes or continues a data set:
///   OUT/images/          the photographs (see placePhotos)
///   OUT/sparse/0, 1 ...  COLMAP models (binary), the largest first; complete as soon as they are there
///   OUT/colmap/          database.db; features.log, matching.log, mapping.log; prepare.json: what is done, and how
/// Phases that an earlier call finished are not repeated, and the one in which it was stopped goes on where it can
/// (features and matches are kept in the database, mapping begins anew). A finished data set is only described.
///
/// Throws IoError when there is no program `colmap` on PATH or a file cannot be written; DataError when OUT holds
/// poses of another origin, or other photographs or options than now, unless `force`; DataError naming the log when
/// COLMAP fails, its last lines told to the report before; Interrupted when the report asks to stop.
PreparedPhotos preparePhotos(const std::filesystem::path& images, const std::filesystem::path& out,
                             const PrepareOptions& options, Report& report);

}  // namespace nerfvdb
