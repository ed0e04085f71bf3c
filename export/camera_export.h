// SPDX-License-Identifier: Apache-2.0
// The photographs' cameras beside an exported volume: as a transforms.json, and as a Blender script that shows the
// volume as it was learned, with a camera for each photograph, so that plates line up.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/similarity.h"
#include "vdb/model.h"

namespace nerfvdb {

/// Writes cameras as instant-ngp and nerfstudio have them (and readTransforms reads them, once photographs lie beside):
/// camera_model, OPENCV, FULL_OPENCV or OPENCV_FISHEYE, for the file and for each frame of another; per frame file_path,
/// w, h, fl_x, fl_y, cx, cy, those of k1, k2, k3, k4, k5, k6, p1, p2 that its model has, transform_matrix (exported world
/// from camera, OpenGL axes, rigid); train_filenames and test_filenames, unless a camera has no name; exported_from_model, the
/// 4x4 matrix of `placement`, whose scale is in the positions of the cameras and not in their axes.
/// Throws IoError.
void writeCamerasJson(const std::filesystem::path& path, std::span<const ModelCamera> cameras,
                      const Similarity& placement);

/// What the script has to know of the files that lie beside it.
struct BlenderScene {
    std::vector<std::string> volumes = {};  // file names; more than one where the volume is cut into tiles
    std::string cameras = {};             // file name of the JSON; empty: no cameras
    std::string density_name = "density";
    std::string color_name = "color";     // empty: the volume has no colour
    UpAxis up = UpAxis::z;                // of the exported world; the script turns it to Blender's z
};

/// Writes a Python script for Blender 3.4 and later (blender_scene.py; its head says how to call it).
/// Throws UsageError for names that are no plain file names in UTF-8, IoError.
void writeBlenderScript(const std::filesystem::path& path, const BlenderScene& scene);

}  // namespace nerfvdb
