// SPDX-License-Identifier: Apache-2.0
#include "export/camera_export.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "core/atomic_file.h"
#include "core/error.h"
#include "export/blender_scene.h"

namespace nerfvdb {
namespace {

using Json = nlohmann::ordered_json;  // keys in the order in which people look for them

Json matrixRows(const Mat3d& linear, const Vec3d& translation) {
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r) rows.push_back({linear(r, 0), linear(r, 1), linear(r, 2), translation[r]});
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    return rows;
}

/// As nerfstudio and COLMAP call it. OPENCV is the least that tells of all flaws.
const char* modelName(const Distortion& d) {
    if (d.model == LensModel::fisheye) return "OPENCV_FISHEYE";
    return d.k4 != 0 || d.k5 != 0 || d.k6 != 0 ? "FULL_OPENCV" : "OPENCV";
}

Json frameOf(const ModelCamera& entry, const Similarity& placement, const std::string& file_model) {
    const Camera camera = placement.apply(entry.camera);
    const Distortion& d = camera.distortion;
    const std::string model = modelName(d);
    Json frame = {{"file_path", entry.name},
                  {"held_out", entry.held_out},
                  {"w", camera.width},
                  {"h", camera.height},
                  {"fl_x", camera.fx},
                  {"fl_y", camera.fy},
                  {"cx", camera.cx},
                  {"cy", camera.cy}};
    if (model != file_model) frame["camera_model"] = model;
    frame["k1"] = d.k1;
    frame["k2"] = d.k2;
    frame["k3"] = d.k3;
    if (model != "OPENCV") frame["k4"] = d.k4;
    if (model == "FULL_OPENCV") {
        frame["k5"] = d.k5;
        frame["k6"] = d.k6;
    }
    if (model != "OPENCV_FISHEYE") {
        frame["p1"] = d.p1;
        frame["p2"] = d.p2;
    }
    frame["transform_matrix"] = matrixRows(camera.world_from_camera, camera.position);
    return frame;
}

std::string textOf(const Json& json) {
    try {
        return json.dump(1);
    } catch (const Json::exception&) {
        throw UsageError("exported cameras", "a file name that is not UTF-8", "one that JSON can say");
    }
}

}  // namespace

void writeCamerasJson(const std::filesystem::path& path, std::span<const ModelCamera> cameras,
                      const Similarity& placement) {
    Json frames = Json::array(), trained_on = Json::array(), held_out = Json::array();
    const std::string file_model = cameras.empty() ? "OPENCV" : modelName(cameras.front().camera.distortion);
    bool all_have_names = true, any_distorted = false, any_fisheye = false;
    for (const ModelCamera& entry : cameras) {
        frames.push_back(frameOf(entry, placement, file_model));
        (entry.held_out ? held_out : trained_on).push_back(entry.name);
        all_have_names &= !entry.name.empty();
        any_distorted |= !entry.camera.distortion.isZero();
        any_fisheye |= entry.camera.distortion.model == LensModel::fisheye;
    }
    Json document = {{"camera_model", file_model},
                     {"exported_from_model", matrixRows(placement.scale * placement.rotation, placement.translation)}};
    if (any_fisheye)
        document["warning"] = "photographs were taken with a fisheye lens (OPENCV_FISHEYE), which the pinholes that "
                              "stand for them in Blender cannot show: undistort plates before lining them up";
    else if (any_distorted)
        document["warning"] = "photographs have lens distortion (k1 ...), which Blender's cameras cannot show: "
                              "undistort plates before lining them up";
    if (all_have_names) {
        document["train_filenames"] = trained_on;
        if (!held_out.empty()) document["test_filenames"] = held_out;
    }
    document["frames"] = frames;
    writeAtomically(path, textOf(document) + "\n");
}

void writeBlenderScript(const std::filesystem::path& path, const BlenderScene& scene) {
    std::vector<std::string> names = scene.volumes;
    if (names.empty()) throw UsageError("Blender script", "no volume", "the volumes beside it");
    if (!scene.cameras.empty()) names.push_back(scene.cameras);
    for (const std::string& name : names)
        if (name.empty() || std::filesystem::path(name).filename() != name)
            throw UsageError("Blender script", "'" + name + "'", "the name of a file beside it");

    // Strings and lists read in Python as they do in JSON.
    const Json known = {{"volumes", scene.volumes},
                        {"cameras", scene.cameras},
                        {"density", scene.density_name},
                        {"color", scene.color_name},
                        {"up", scene.up == UpAxis::y ? "y" : "z"}};
    constexpr std::string_view kPlace = "SCENE = None";
    std::string script = kBlenderScene;
    script.replace(script.find(kPlace), kPlace.size(), "SCENE = " + textOf(known));
    writeAtomically(path, script);
}

}  // namespace nerfvdb
