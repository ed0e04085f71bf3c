// SPDX-License-Identifier: Apache-2.0
// Cameras that no photograph was taken with: from a file, or on a circle around the scene.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "core/camera.h"
#include "core/similarity.h"

namespace nerfvdb {

/// What the command line says; absent values come from the file, or from defaults.
struct PictureSize {
    std::optional<int> width, height;  // pixels
    std::optional<double> fov_y_rad;
};

/// Reads nerfstudio's camera path: {"camera_type": "perspective", "render_width", "render_height",
/// "camera_path": [{"camera_to_world": 16 numbers row by row, "fov": vertical degrees, "aspect"}, ...]}.
/// Throws IoError / DataError naming file and field.
std::vector<Camera> readCameraPath(const std::filesystem::path& path, const PictureSize& size);

/// `count` cameras evenly around the box at 25 degrees above its middle, as near as all of it fits the picture
/// (800x800 and 40 degrees unless said otherwise).
std::vector<Camera> orbitCameras(const Box& box, int count, UpAxis up, const PictureSize& size);

}  // namespace nerfvdb
