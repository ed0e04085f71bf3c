// SPDX-License-Identifier: Apache-2.0
// The sparse points of a capture that are laid beside its transforms.json (nerfstudio's "ply_file_path").
#pragma once

#include <filesystem>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

/// x, y and z of all vertices, in the file's order; text, or binary little-endian. What is not finite comes as it is.
/// Throws IoError, DataError: no vertices first, none with x, y and z, a list among their properties, fewer than stated.
std::vector<Vec3d> readPlyPoints(const std::filesystem::path& path);

}  // namespace nerfvdb
