// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_lens.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr std::array<ColmapLensModel, 9> kSupported{{{0, "SIMPLE_PINHOLE", 3},
                                                     {1, "PINHOLE", 4},
                                                     {2, "SIMPLE_RADIAL", 4},
                                                     {3, "RADIAL", 5},
                                                     {4, "OPENCV", 8},
                                                     {5, "OPENCV_FISHEYE", 8},
                                                     {6, "FULL_OPENCV", 12},
                                                     {8, "SIMPLE_RADIAL_FISHEYE", 4},
                                                     {9, "RADIAL_FISHEYE", 5}}};

constexpr std::uint64_t kMaxSide = 1 << 20;  // pixels

template <typename IsIt>
const ColmapLensModel& find(const IsIt& isIt, const std::string& found, const std::string& where) {
    const auto model = std::find_if(kSupported.begin(), kSupported.end(), isIt);
    if (model == kSupported.end())
        throw DataError(where, "the lens model " + found,
                        "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, "
                        "SIMPLE_RADIAL_FISHEYE or RADIAL_FISHEYE",
                        "map again with one of these, or run colmap image_undistorter");
    return *model;
}

}  // namespace

const ColmapLensModel& colmapLensModel(int id, const std::string& where) {
    constexpr std::array<std::pair<int, const char*>, 3> kKnown{
        {{7, "FOV"}, {10, "THIN_PRISM_FISHEYE"}, {11, "RAD_TAN_THIN_PRISM_FISHEYE"}}};
    std::string name = std::to_string(id);
    for (const auto& [known, its_name] : kKnown)
        if (id == known) name = its_name;
    return find([&](const ColmapLensModel& model) { return model.id == id; }, name, where);
}

const ColmapLensModel& colmapLensModel(const std::string& name, const std::string& where) {
    std::string quoted;  // fit to be printed
    for (const char c : name.substr(0, 60)) quoted += c > 0x20 && c < 0x7f ? c : '?';
    return find([&](const ColmapLensModel& model) { return model.name == name; }, quoted, where);
}

Camera cameraOf(const ColmapCamera& source, const std::string& where) {
    if (source.width < 1 || source.height < 1 || source.width > kMaxSide || source.height > kMaxSide)
        throw DataError(where, "images of " + std::to_string(source.width) + "x" + std::to_string(source.height),
                        "1 to " + std::to_string(kMaxSide) + " pixels along each side");
    Camera camera;
    camera.width = static_cast<int>(source.width);
    camera.height = static_cast<int>(source.height);
    const std::string_view model = source.model;
    const double* next = source.parameters.data();
    const bool has_one_focal_length = model.starts_with("SIMPLE_") || model.starts_with("RADIAL");
    camera.fx = *next++;
    camera.fy = has_one_focal_length ? camera.fx : *next++;
    camera.cx = *next++;
    camera.cy = *next++;

    Distortion& d = camera.distortion;
    if (model.ends_with("FISHEYE")) d.model = LensModel::fisheye;
    if (model == "SIMPLE_RADIAL" || model == "SIMPLE_RADIAL_FISHEYE") {
        d.k1 = next[0];
    } else if (model == "RADIAL" || model == "RADIAL_FISHEYE") {
        d.k1 = next[0], d.k2 = next[1];
    } else if (model == "OPENCV_FISHEYE") {
        d.k1 = next[0], d.k2 = next[1], d.k3 = next[2], d.k4 = next[3];
    } else if (model == "OPENCV" || model == "FULL_OPENCV") {
        d.k1 = next[0], d.k2 = next[1], d.p1 = next[2], d.p2 = next[3];
        if (model == "FULL_OPENCV") d.k3 = next[4], d.k4 = next[5], d.k5 = next[6], d.k6 = next[7];
    }
    return camera;
}

}  // namespace nerfvdb
