// SPDX-License-Identifier: Apache-2.0
// A sparse model as COLMAP has it (cameras, images, points3D; binary or text), before a data set is made of it.
// Source: https://colmap.github.io/format.html
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

struct ColmapCamera {
    std::uint32_t id = 0;
    std::string model;               // such as "OPENCV", one of colmap_lens.h
    std::uint64_t width = 0, height = 0;
    std::vector<double> parameters;  // as many as the model has, in COLMAP's order
};

/// Where an image shows a point.
struct ColmapObservation {
    Vec2d pixel;          // (0, 0) is the upper left corner
    std::uint64_t point;  // its id
};

/// A registered image. x_in_camera = R(rotation) x_in_world + translation; +x right, +y down, +z forward.
struct ColmapImage {
    std::uint32_t id = 0;
    std::array<double, 4> rotation{};  // w, x, y, z
    Vec3d translation = Vec3d::Zero();
    std::uint32_t camera = 0;          // id
    std::string name;                  // path in the folder of images
    std::vector<ColmapObservation> observations;  // of points; features without one are left out
};

struct ColmapPoint {
    std::uint64_t id = 0;
    Vec3d position = Vec3d::Zero();
    std::size_t track_length = 0;  // images that show it
};

/// A part of a model and the file that it came from.
template <typename T>
struct ColmapPart {
    std::filesystem::path file;
    std::vector<T> entries;  // in the order of their ids
};

/// True if the folder holds any file of a model.
bool isColmapModel(const std::filesystem::path& folder);

/// Each part alone, from NAME.bin or, where there is none, NAME.txt. Ids are unique, numbers may be any (NaN too).
/// Throws IoError, or DataError naming file and entry: absent or cut short, garbage, counts that the file cannot hold,
/// lens models that are not supported. Memory: a small multiple of the file's size, whatever it claims.
ColmapPart<ColmapCamera> readColmapCameras(const std::filesystem::path& folder);
ColmapPart<ColmapImage> readColmapImages(const std::filesystem::path& folder);
ColmapPart<ColmapPoint> readColmapPoints(const std::filesystem::path& folder);

}  // namespace nerfvdb
