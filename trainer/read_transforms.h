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
/// without fl_*), camera_model (PINHOLE, OPENCV and what it contains, FULL_OPENCV, OPENCV_FISHEYE; see Distortion),
/// is_fisheye (instant-ngp), k1 ... k6, p1, p2 as the model has them. For the file: aabb_scale, train_filenames,
/// val_filenames, test_filenames, ply_file_path (nerfstudio; sparse points, of the train split; what is wrong with them is a
/// warning). For a frame: file_path (as placeInside has it; the extension may be left out), mask_path (the same),
/// transform_matrix (world from camera, OpenGL axes, rigid; cleaned of rounding).
/// Known and not used: applied_transform and applied_scale (poses have them applied already, and the world is the
/// file's), depth_file_path.
///
/// Throws DataError naming file and field: absent keys, values that make no camera, lens models that are not
/// supported, a size that contradicts the image, an absent mask, an empty split, fewer than
/// half of the images present (with `strict`: any absent).
/// Without `check_poses`, cameras that cameraProblem() complains about come as they are written.
Dataset readTransforms(const std::filesystem::path& path, Split split, bool strict, bool check_poses = true);

}  // namespace nerfvdb
