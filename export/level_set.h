// SPDX-License-Identifier: Apache-2.0
// A closed mesh as signed distances in a narrow band, as collision, remeshing and Boolean tools take surfaces.
#pragma once

#include <cstddef>
#include <filesystem>

#include "core/similarity.h"
#include "export/mesh.h"

namespace nerfvdb {

/// Writes a .vdb of one grid, "surface": float, level set, distance in units of the file, negative inside, three voxels
/// to either side; voxels of `voxel_size` model units. `placement` leads from the mesh's world to the file's.
/// Equal input gives equal bytes. Returns the number of active voxels.
/// Throws DataError (a mesh without triangles or that is not closed: it has no inside), IoError.
std::size_t writeLevelSet(const std::filesystem::path& path, const Mesh& mesh, double voxel_size,
                          const Similarity& placement);

}  // namespace nerfvdb
