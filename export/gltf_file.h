// SPDX-License-Identifier: Apache-2.0
// Meshes as binary glTF 2.0 (.glb), the format that web viewers, engines and Windows open. The only file that knows
// tinygltf is beside it.
#pragma once

#include <filesystem>

#include "core/similarity.h"
#include "export/mesh.h"

namespace nerfvdb {

/// Writes one node with one mesh of one primitive: POSITION, NORMAL and COLOR_0 (as there are), uint32 indices.
///
/// glTF's +Y points up: where `up` says that z does in the mesh's world, the node turns it, and positions stay as they
/// are. COLOR_0 is linear, as glTF wants it: 16 bits a channel, since 8 would coarsen what is dark, and an alpha of 1
/// that keeps vertices aligned. A mesh with colours is KHR_materials_unlit: photographs have their light in them.
///
/// Memory: twice the file. Throws IoError that names `path` when `temporary`, which is to become it, cannot be written
/// to the end, DataError for a mesh of 4 GiB or
/// more, the most that .glb can hold, and for one without triangles, which glTF does not know.
void writeGlb(const std::filesystem::path& temporary, const std::filesystem::path& path, const Mesh& mesh, UpAxis up);

}  // namespace nerfvdb
