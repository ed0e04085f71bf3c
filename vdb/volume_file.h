// SPDX-License-Identifier: Apache-2.0
// Plain volumes in .vdb files of standard grids, ours and those of other programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "vdb/volume.h"

namespace nerfvdb {

struct WriteVolumeOptions {
    bool half = true;                   // 16-bit floats where they can say every value, else 32
    bool color = true;
    std::string color_name = "color";   // Houdini looks for "Cd"
    std::optional<Vec3f> background;    // sRGB values, noted in the file for pictures of it
};

struct WrittenVolume {
    std::size_t active_voxels = 0;  // of "density"
    std::size_t bytes = 0;          // of the file
    bool half = false;              // density is stored as half
};

/// Writes a .vdb of standard grids, fit for any program, atomically and sealed (vdb_file.h):
///   "density"     FloatGrid, fog volume, 1 / world unit; active where sigma is not zero
///   "color"       Vec3SGrid, linear RGB (Rec. 709 primaries); active wherever a colour is not black, also beyond the
///                 density, so that interpolation does not darken its border
/// Both have background zero, and a transform from integer index coordinates to world positions.
/// Equal volumes give equal bytes. Throws IoError, DataError (voxels too small for OpenVDB).
WrittenVolume writeVolume(const std::filesystem::path& path, const Volume& volume, const WriteVolumeOptions& options);

/// A volume from a file, and what the file says beside it.
struct VolumeFile {
    Volume volume;
    bool has_color = false;            // else everything is white
    std::optional<Vec3f> background;   // as WriteVolumeOptions::background
};

/// Reads the float grid "density" (or the only float fog volume) and a vec3 grid "color" or "Cd".
/// Throws IoError, or DataError with what was found: no .vdb; damaged (ours are sealed); no density; a level set;
/// grids that do not share their transform; voxels that are no cubes; fog without end (a grid background that is not
/// zero); values that are negative or not finite; more than memory holds.
VolumeFile readVolume(const std::filesystem::path& path);

}  // namespace nerfvdb
