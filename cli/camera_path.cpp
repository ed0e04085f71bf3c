// SPDX-License-Identifier: Apache-2.0
#include "cli/camera_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "trainer/json_node.h"

namespace nerfvdb {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kMaxPixels = 32768;  // along an edge

int pixels(const JsonNode& node) {
    const double value = node.number();
    if (!(value >= 1 && value <= kMaxPixels)) node.fail(std::to_string(value), "pixels from 1 to 32768");
    return static_cast<int>(value);
}

double angle(const JsonNode& node) {
    const double degrees = node.number();
    if (!(degrees > 0 && degrees < 180)) node.fail(std::to_string(degrees), "degrees between 0 and 180");
    return degrees * kDegree;
}

Camera pathCamera(const JsonNode& entry, int width, int height, const std::optional<double>& fov_y_rad) {
    const JsonNode matrix = entry.at("camera_to_world");
    if (matrix.arraySize() != 16)
        matrix.fail(std::to_string(matrix.arraySize()) + " elements", "16 numbers, row by row");

    Camera camera;
    camera.width = width;
    camera.height = height;
    const double fov = fov_y_rad ? *fov_y_rad : angle(entry.at("fov"));
    camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * fov);
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column)
            camera.world_from_camera(row, column) = matrix.element(row * 4 + column).number();
        camera.position[row] = matrix.element(row * 4 + 3).number();
    }
    const std::string problem = cameraProblem(camera);
    if (!problem.empty()) entry.fail(problem, "a usable camera (rigid pose, camera to world)");
    return camera;
}

}  // namespace

std::vector<Camera> readCameraPath(const std::filesystem::path& path, const PictureSize& size) {
    const nlohmann::json json = parseJsonFile(path);
    const JsonNode document(json, path);
    if (!document.has("camera_path"))
        document.fail("JSON without a list 'camera_path'", "a nerfstudio camera path",
                      "other formats are not read; data sets go by --data");
    const JsonNode entries = document.at("camera_path");
    if (entries.arraySize() == 0) entries.fail("an empty list", "at least one camera");
    if (document.has("camera_type"))
        if (const JsonNode type = document.at("camera_type"); type.text() != "perspective")
            type.fail("'" + type.text() + "'", "'perspective'", "other lenses cannot be rendered");

    const int width = size.width ? *size.width : pixels(document.at("render_width"));
    const int height = size.height ? *size.height : pixels(document.at("render_height"));
    std::vector<Camera> cameras;
    for (std::size_t i = 0; i < entries.arraySize(); ++i)
        cameras.push_back(pathCamera(entries.element(i), width, height, size.fov_y_rad));
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
