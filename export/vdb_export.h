// SPDX-License-Identifier: Apache-2.0
// A model as a plain volume for other programs: density and colour without view-dependence.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/report.h"
#include "core/similarity.h"
#include "core/types.h"
#include "export/placement.h"
#include "export/volume_loss.h"
#include "vdb/model.h"

namespace nerfvdb {

struct ExportVdbOptions {
    enum class Color {
        none,
        mean,     // what each voxel's features decode to, averaged over all directions (decodeColors)
        diffuse,  // as the training views saw each voxel (collectColors); `mean` for a model that names no cameras
    };
    Color color = Color::diffuse;
    std::string color_name = "color";
    /// Voxels whose alpha over one voxel edge is below are left out. Absent: 1e-3 for a model that names no cameras;
    /// else 1e-5, and what no camera sees is left out, too (see collectColors).
    std::optional<double> min_alpha;
    int fit_steps = 1000;             // of VolumeFit; 0: none. Needs cameras and colour
    /// Voxels of the model's over those written, 1 to 4: what is thinner than a voxel of the model keeps its shape on
    /// finer ones. Absent: 1, or up to 3, as long as the volume falls a decibel or more behind what the model shows
    /// without view-dependence, and stays below 30 million voxels; 1 without cameras, with a limit, or unfitted.
    std::optional<int> finer;
    double max_resolution = 0;        // voxels along the longest side of what is written; 0: as the model
    double max_voxels = 0;            // active voxels; 0: no limit
    double max_blender_bytes = 0;     // blenderBytes of all that is written; 0: no limit
    std::optional<Box> bounds;        // only what lies inside, world units of the model
    std::optional<Box> outside;       // only voxels outside of this box and its faces, world units of the model
    PlacementOptions placement;       // where the file's world has what is written ...
    std::optional<Box> placed_by;     // ... or another part of the scene, which comes to lie in the origin
    int tiles = 1;                    // files, slabs along the longest side, on the same voxels
    bool half = true;                 // 16-bit floats where they can say every value, else 32
};

/// What was written, and what a plain volume cannot say.
struct ExportVdbReport {
    struct File {
        std::filesystem::path path;
        std::size_t active_voxels = 0, bytes = 0;
    };
    std::vector<File> files;
    std::size_t active_voxels = 0;   // of "density", of all files
    std::size_t left_out = 0;        // voxels that stop light, but show to nobody
    std::size_t bytes = 0;
    Similarity placement;            // from the model's world to the file's
    double voxel_size = 0;           // units of the file
    double finer = 1;                // the model's voxels over these
    Box bounds;                      // of the active voxels, in the model's world
    Vec3i box_voxels = Vec3i::Zero();  // of these bounds, which some programs make dense
    double blender_bytes = 0;        // blenderBytes
    bool half = false;               // density is stored as half
    bool has_view_colors = false;    // colours are as the training views saw them
    std::optional<VolumeLoss> loss;  // on held-out views, else on training views; absent if the model names none
};

/// Writes `path`, or for several tiles NAME.000.vdb, NAME.001.vdb, ... beside it: see writeVolume for the grids.
/// Equal models and options give equal bytes, on any number of threads.
/// Throws IoError (files that stood there are then untouched, but for tiles that were written before), UsageError,
/// DataError (nothing within the bounds), Interrupted.
ExportVdbReport exportVdb(const Model& model, const std::filesystem::path& path, const ExportVdbOptions& options,
                          Report& report);

/// The files that exportVdb writes.
std::vector<std::filesystem::path> exportPaths(const std::filesystem::path& path, int tiles);

}  // namespace nerfvdb
