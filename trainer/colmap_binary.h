// SPDX-License-Identifier: Apache-2.0
// COLMAP's binary files: cameras.bin, images.bin, points3D.bin.
#pragma once

#include "trainer/colmap_model.h"

namespace nerfvdb {

/// Entries in the order of the file; errors as in colmap_model.h.
std::vector<ColmapCamera> readColmapCamerasBinary(const std::filesystem::path& file);
std::vector<ColmapImage> readColmapImagesBinary(const std::filesystem::path& file);
std::vector<ColmapPoint> readColmapPointsBinary(const std::filesystem::path& file);

}  // namespace nerfvdb
