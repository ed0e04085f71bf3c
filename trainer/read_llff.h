// SPDX-License-Identifier: Apache-2.0
// LLFF's poses_bounds.npy (Mildenhall et al. 2019, "Local Light Field Fusion") as a data set.
#pragma once

#include <filesystem>

#include "trainer/dataset.h"

namespace nerfvdb {

/// True if the folder holds poses_bounds.npy.
bool hasLlff(const std::filesystem::path& folder);

/// Cameras and image paths of one split, no pixels: every 8th frame, sorted by name, is held out. The file has a row of
/// 17 numbers for each image of images (or images_2, images_4, images_8), sorted by name: a 3x5 matrix whose columns are
/// the camera's down, right and backward axes, its position, and height, width and focal length in pixels of the full
/// images (scaled to the size of those that are there); then the depths between which the scene lies, which
/// View::depth_range keeps where they are such. The lens is a pinhole.
///
/// Throws DataError naming file and row: another shape, numbers that make no camera, as many images as there are not
/// rows, sizes that contradict the images, an empty split.
Dataset readLlff(const std::filesystem::path& folder, Split split);

}  // namespace nerfvdb
