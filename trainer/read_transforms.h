// SPDX-License-Identifier: Apache-2.0
// The transforms.json family: NeRF-synthetic's split files, and the single file of instant-ngp and nerfstudio.
#pragma once

#include <filesystem>

#include "trainer/dataset.h"

namespace nerfvdb {

/// True if the path is a JSON file or a folder that holds transforms.json or one with a split's name.
bool hasTransforms(const std::filesystem::path& path);

/// Cameras and image paths of one split, no pixels (sizes and alpha come from the images' headers).
///
/// Keys, each for the whole file or for one frame: w, h, fl_x, fl_y, cx, cy (pixels of the w x h image; scaled
/// when the image at hand has another size of the same aspect), camera_angle_x, camera_angle_y (rad; used
/// without fl_*), k1 k2 k3 p1 p2 (OpenCV), camera_model (pinhole or OPENCV). For the file: aabb_scale,
/// train_filenames, val_filenames, test_filenames (nerfstudio). For a frame: file_path (relative; the extension
/// may be left out), transform_matrix (world from camera, OpenGL axes, rigid; cleaned of rounding).
///
/// Throws DataError naming file and field: absent keys, values that make no camera, lens models that are not
/// supported, a size that contradicts the image, a file_path outside the folder, an empty split, fewer than
/// half of the images present (with `strict`: any absent).
/// Without `check_poses`, cameras that cameraProblem() complains about come as they are written.
Dataset readTransforms(const std::filesystem::path& path, Split split, bool strict, bool check_poses = true);

}  // namespace nerfvdb
