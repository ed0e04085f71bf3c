// SPDX-License-Identifier: Apache-2.0
#include "cli/camera_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

using nlohmann::json;

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kMaxPixels = 32768;  // along an edge

double number(const json& object, const std::string& key, const std::string& where) {
    const auto found = object.find(key);
    if (found == object.end()) throw DataError(where + ", field " + key, "nothing", "a number");
    if (!found->is_number()) throw DataError(where + ", field " + key, found->dump(), "a number");
    return found->get<double>();
}

int pixels(const json& object, const std::string& key, const std::string& where) {
    const double value = number(object, key, where);
    if (!(value >= 1 && value <= kMaxPixels))
        throw DataError(where + ", field " + key, std::to_string(value), "pixels from 1 to 32768");
    return static_cast<int>(value);
}

Camera pathCamera(const json& entry, int width, int height, const std::optional<double>& fov_y_rad,
                  const std::string& where) {
    if (!entry.is_object()) throw DataError(where, entry.type_name(), "an object");
    const auto matrix = entry.find("camera_to_world");
    const bool is_flat =
        matrix != entry.end() && matrix->is_array() && matrix->size() == 16 &&
        std::all_of(matrix->begin(), matrix->end(), [](const json& v) { return v.is_number(); });
    if (!is_flat)
        throw DataError(where + ", field camera_to_world",
                        matrix == entry.end() ? "nothing" : matrix->dump().substr(0, 60),
                        "16 numbers, row by row");

    Camera camera;
    camera.width = width;
    camera.height = height;
    const double fov = fov_y_rad ? *fov_y_rad : number(entry, "fov", where) * kDegree;
    if (!(fov > 0 && fov < std::numbers::pi))
        throw DataError(where + ", field fov", std::to_string(fov / kDegree), "degrees between 0 and 180");
    camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * fov);
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            camera.world_from_camera(row, column) = (*matrix)[row * 4 + column].get<double>();
        camera.position[row] = (*matrix)[row * 4 + 3].get<double>();
    }
    const std::string problem = cameraProblem(camera);
    if (!problem.empty()) throw DataError(where + ": " + problem);
    return camera;
}

}  // namespace

std::vector<Camera> readCameraPath(const std::filesystem::path& path, const PictureSize& size) {
    const std::string name = path.string();
    const json root = json::parse(readFile(path), nullptr, false);
    if (root.is_discarded()) throw DataError(name, "text that is no JSON", "a nerfstudio camera path (JSON)");
    const auto entries = root.is_object() ? root.find("camera_path") : root.end();
    if (!root.is_object() || entries == root.end() || !entries->is_array())
        throw DataError(name, "JSON without a list 'camera_path'", "a nerfstudio camera path",
                        "other formats are not read; data sets go by --data");
    if (entries->empty()) throw DataError(name + ", field camera_path", "an empty list", "at least one camera");
    const std::string type = root.value("camera_type", json("perspective")).dump();
    if (type != "\"perspective\"")
        throw DataError(name + ", field camera_type", type, "\"perspective\"",
                        "other lenses cannot be rendered");

    const int width = size.width ? *size.width : pixels(root, "render_width", name);
    const int height = size.height ? *size.height : pixels(root, "render_height", name);
    std::vector<Camera> cameras;
    for (std::size_t i = 0; i < entries->size(); ++i)
        cameras.push_back(pathCamera((*entries)[i], width, height, size.fov_y_rad,
                                     name + ", camera_path[" + std::to_string(i) + "]"));
    return cameras;
}

std::vector<Camera> orbitCameras(const Box& box, int count, UpAxis up_axis, const PictureSize& size) {
    constexpr double kElevation = 25 * kDegree;
    const int width = size.width.value_or(800), height = size.height.value_or(800);
    const double fov_y = size.fov_y_rad.value_or(40 * kDegree);
    const double fov_x = 2 * std::atan(std::tan(0.5 * fov_y) * width / height);
    const double distance = 0.5 * box.size().norm() / std::sin(0.5 * std::min(fov_x, fov_y));

    // Right-handed: the first horizontal axis, the second, and up.
    const Vec3d up = up_axis == UpAxis::z ? Vec3d::UnitZ() : Vec3d::UnitY();
    const Vec3d east = up_axis == UpAxis::z ? Vec3d::UnitX() : Vec3d::UnitZ();
    const Vec3d north = up.cross(east);
    std::vector<Camera> cameras;
    for (int i = 0; i < count; ++i) {
        const double azimuth = 2 * std::numbers::pi * i / count;
        const Vec3d outward = std::cos(kElevation) * (std::cos(azimuth) * east + std::sin(azimuth) * north) +
                              std::sin(kElevation) * up;
        cameras.push_back(lookAt(box.center() + distance * outward, box.center(), up, fov_y, width, height));
    }
    return cameras;
}

}  // namespace nerfvdb
