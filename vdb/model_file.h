// SPDX-License-Identifier: Apache-2.0
// model.vdb: a standard .vdb file that other programs open (float grid "density", fog volume, 1 / world unit, a preview
// at half the resolution), in which the learned values travel: raw densities and features, rounded as value_steps.h
// says, and network weights, exactly.
// Layout and version: see model_file.cpp.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "vdb/model.h"

namespace nerfvdb {

/// What saving rounds: learned values to the precision that the file keeps. saveModel(loadModel(p)) repeats the
/// file byte for byte.
void saveModel(const Model& model, const std::filesystem::path& path);

/// Throws IoError / DataError: not a .vdb, a .vdb that is not a model, a damaged or truncated model (its
/// checksum is verified before anything is parsed), a version that this program does not know.
Model loadModel(const std::filesystem::path& path);

/// One grid of a .vdb file.
struct GridFacts {
    std::string name, type;  // type of a value, such as "float"
    std::string grid_class;  // "fog volume", "level set", "unknown", ... as OpenVDB says
    std::size_t active_voxels = 0;
    Vec3i dims = Vec3i::Zero();          // of the smallest box of voxels around the active ones
    Vec3d voxel_size = Vec3d::Zero();    // world units along the grid's own axes
    Box bounds;                          // world box of that box of voxels, their whole cubes; zero when none is active
};

/// The grids that other programs find in a .vdb file. Throws DataError when it is none, or one that this program wrote
/// and that was damaged since.
std::vector<GridFacts> listGrids(const std::filesystem::path& path);

/// True for models, whole or damaged, of any version: not for other .vdb files. Throws as isVdbFile.
bool isModelFile(const std::filesystem::path& path);

/// True if the file begins as a .vdb does. Throws IoError when it cannot be read.
bool isVdbFile(const std::filesystem::path& path);

/// True for a .vdb that another program wrote. Throws as isVdbFile.
bool isForeignVdbFile(const std::filesystem::path& path);

}  // namespace nerfvdb
