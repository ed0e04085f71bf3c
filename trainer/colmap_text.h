// SPDX-License-Identifier: Apache-2.0
// COLMAP's text files: cameras.txt, images.txt, points3D.txt.
#pragma once

#include "trainer/colmap_model.h"

namespace nerfvdb {

/// Entries in the order of the file; errors as in colmap_model.h, with the line.
std::vector<ColmapCamera> readColmapCamerasText(const std::filesystem::path& file);
std::vector<ColmapImage> readColmapImagesText(const std::filesystem::path& file);
std::vector<ColmapPoint> readColmapPointsText(const std::filesystem::path& file);

}  // namespace nerfvdb
