// SPDX-License-Identifier: Apache-2.0
// A tiny data set on disk, to be bent out of shape by tests of the readers.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "core/atomic_file.h"
#include "core/camera.h"
#include "core/image.h"
#include "tests/support/temp_dir.h"

namespace nerfvdb::testing {

inline nlohmann::json poseJson(const Camera& camera) {
    nlohmann::json rows = nlohmann::json::array();
    for (int r = 0; r < 3; ++r) {
        const auto& m = camera.world_from_camera;
        rows.push_back({m(r, 0), m(r, 1), m(r, 2), camera.position(r)});
    }
    rows.push_back({0, 0, 0, 1});
    return rows;
}

/// Camera number i of n on a ring around the origin.
inline Camera ringCamera(int i, int n, int width, int height) {
    const double angle = 2 * M_PI * i / n;
    return lookAt(Vec3d(4 * std::cos(angle), 4 * std::sin(angle), 2), Vec3d::Zero(), Vec3d::UnitZ(), 0.7, width,
                  height);
}

/// A folder with images `images/NNN.png` of 20x10 pixels and a document that describes them.
class SceneFolder {
public:
    explicit SceneFolder(int n_frames, int channels = 3) {
        std::filesystem::create_directory(dir / "images");
        document = {{"w", 20}, {"h", 10}, {"fl_x", 15.0}, {"fl_y", 15.5}, {"frames", nlohmann::json::array()}};
        for (int i = 0; i < n_frames; ++i) {
            const std::string name = "images/" + std::to_string(100 + i) + ".png";
            Image image(20, 10, channels);
            image.at(0, 0)[0] = static_cast<float>(i) / 255.0f;  // its number, to be recognised by
            writeImage(dir / name, image);
            document["frames"].push_back(
                {{"file_path", name}, {"transform_matrix", poseJson(ringCamera(i, n_frames, 20, 10))}});
        }
    }
    nlohmann::json& frame(int i) { return document["frames"][static_cast<std::size_t>(i)]; }
    void save(const std::string& name = "transforms.json") const {
        writeAtomically(dir / name, document.dump(1));
    }

    TempDir dir;
    nlohmann::json document;
};

}  // namespace nerfvdb::testing
