// SPDX-License-Identifier: Apache-2.0
// COLMAP's sparse models as data sets.
#pragma once

#include <filesystem>

#include "trainer/colmap_model.h"
#include "trainer/dataset.h"

namespace nerfvdb {

/// True if the folder holds a sparse model: in sparse/0 (or another number), sparse, colmap/sparse/0, colmap/sparse or
/// itself.
bool hasColmap(const std::filesystem::path& folder);

/// Cameras and image paths of one split, no pixels: every 8th frame, sorted by name, is held out. Of several models the
/// one with the most registered images is taken, and a warning says so. Images lie in images, or in images_2, images_4
/// or images_8 (another extension will do): lenses are scaled to the size that they have. The world is COLMAP's.
///
/// Dataset::points are those that are finite and that two images or more show, by id. Warnings tell of images without
/// a pose, points that are not finite, and a model that does not fit its own points (see reprojectionError).
///
/// Throws DataError naming file and entry: parts that are absent, cut short or garbage, lens models that are not
/// supported, rotations that are none, names that lead out of the folder, cameras that do not exist, sizes that
/// contradict the images, an empty split, fewer than half of the images present (with `strict`: any absent).
Dataset readColmap(const std::filesystem::path& folder, Split split, bool strict);

/// Median distance in pixels between where images show points and where our cameras project them, over at most about
/// 100 000 observations evenly spread; nothing where no observation's point is known.
std::optional<double> reprojectionError(const ColmapPart<ColmapCamera>& cameras, const ColmapPart<ColmapImage>& images,
                                        const ColmapPart<ColmapPoint>& points);

}  // namespace nerfvdb
