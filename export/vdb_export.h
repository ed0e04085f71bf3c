// SPDX-License-Identifier: Apache-2.0
// A model as a plain volume for other programs: density and colour without view-dependence.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/types.h"
#include "vdb/model.h"

namespace nerfvdb {

struct ExportVdbOptions {
    enum class Color { none, diffuse };
    Color color = Color::diffuse;
    /// Voxels whose alpha over one voxel edge is below are left out. Haze is made of many such voxels: the report
    /// says how much opacity that takes away at most.
    double min_alpha = 1e-3;
    bool half = true;  // 16-bit floats where they can say every value, else 32
};

/// What was written, and what a plain volume cannot say.
struct ExportVdbReport {
    std::size_t active_voxels = 0;   // of "density"
    std::size_t left_out = 0;        // voxels of the model below min_alpha
    double lost_opacity = 0;         // largest opacity that these summed to along a line parallel to an axis
    Box bounds;                      // of the active voxels, world units
    std::size_t bytes = 0;           // of the file
    bool half = false;               // density is stored as half
    std::vector<std::string> lost;   // one sentence each
};

/// Writes a .vdb of standard grids, fit for any program:
///   "density"  FloatGrid, fog volume, 1 / world unit; capped where one voxel is opaque (volumeSigma)
///   "color"    Vec3SGrid, linear RGB (Rec. 709 primaries), the mean over all directions; also one voxel beyond the
///              density where the model has values, so that interpolation does not darken the border
/// The background of both is zero; their transform maps integer index coordinates to world positions.
/// Equal models give equal bytes. Throws IoError (the file at `path` is then untouched) and UsageError.
ExportVdbReport exportVdb(const Model& model, const std::filesystem::path& path,
                          const ExportVdbOptions& options = {});

}  // namespace nerfvdb
