// SPDX-License-Identifier: Apache-2.0
#include "trainer/write_dataset.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/image.h"
#include "core/parallel.h"
#include "core/random.h"
#include "trainer/exact_ray.h"

namespace nerfvdb {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kDistance = 4.0311289;              // of NeRF-synthetic's cameras, world units
constexpr double kFieldOfView = 0.6911112070083618;  // of NeRF-synthetic's cameras, radians
constexpr int kMaxViews = 10000, kMaxSide = 8192;

const char* splitName(Split split) {
    return split == Split::train ? "train" : split == Split::val ? "val" : "test";
}

void check(const SyntheticDatasetOptions& options) {
    const auto inRange = [](const char* what, int value, int low, int high) {
        if (value < low || value > high)
            throw UsageError("synthetic data set: " + std::string(what), std::to_string(value),
                             std::to_string(low) + " to " + std::to_string(high));
    };
    inRange("width", options.width, 1, kMaxSide);
    inRange("height", options.height, 1, kMaxSide);
    inRange("train views", options.train_views, 1, kMaxViews);
    inRange("val views", options.val_views, 0, kMaxViews);
    inRange("test views", options.test_views, 0, kMaxViews);
}

void makeFolder(const std::filesystem::path& folder) {
    std::error_code failure;
    std::filesystem::create_directories(folder, failure);
    if (failure || !std::filesystem::is_directory(folder))
        throw IoError(folder.string(), failure ? failure.message() : "something that is not a folder",
                      "a folder, or a place where one can be made", "choose another output folder");
}

nlohmann::json toJson(const Camera& camera, const std::string& file_path) {
    auto rows = nlohmann::json::array();
    for (int r = 0; r < 3; ++r) {
        const auto axes = camera.world_from_camera.row(r);
        rows.push_back({axes[0], axes[1], axes[2], camera.position[r]});
    }
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    return {{"file_path", file_path}, {"transform_matrix", rows}};
}

}  // namespace

int viewCount(Split split, const SyntheticDatasetOptions& options) {
    return split == Split::train ? options.train_views
           : split == Split::val ? options.val_views
                                 : options.test_views;
}

std::vector<Camera> syntheticCameras(Split split, const SyntheticDatasetOptions& options) {
    check(options);
    const int n = viewCount(split, options);
    const double turn =
        2.0 * kPi * (randomBits(options.seed, static_cast<std::uint64_t>(split), 0) >> 11) * 0x1p-53;
    const double aspect = static_cast<double>(options.height) / options.width;
    const double fov_y = 2.0 * std::atan(std::tan(kFieldOfView / 2.0) * std::max(aspect, 1.0));
    std::vector<Camera> cameras;
    for (int i = 0; i < n; ++i) {
        const double s = (i + 0.5) / n;
        double height, azimuth;  // sine of the elevation; radians
        if (split == Split::test) {
            height = std::sin((5.0 + 60.0 * s) * kPi / 180.0);
            azimuth = turn + 2.0 * 2.0 * kPi * s;
        } else {
            // Fibonacci's lattice: equal areas, turned by the golden angle from one to the next.
            height = 0.985 - (0.985 + 0.17) * s;
            azimuth = turn + kPi * (3.0 - std::sqrt(5.0)) * i;
        }
        const double radius = std::sqrt(1.0 - height * height);
        const Vec3d eye = kDistance * Vec3d(radius * std::cos(azimuth), radius * std::sin(azimuth), height);
        cameras.push_back(lookAt(eye, Vec3d::Zero(), Vec3d::UnitZ(), fov_y, options.width, options.height));
    }
    return cameras;
}

void writeSyntheticDataset(const SyntheticScene& scene, const std::filesystem::path& folder,
                           const SyntheticDatasetOptions& options, Report& report) {
    writePictures(
        folder, options, [&](Split split) { return syntheticCameras(split, options); },
        [&](const Camera& camera) { return exactImage(scene, camera); }, report);
}

void writePictures(const std::filesystem::path& folder, const SyntheticDatasetOptions& options,
                   const std::function<std::vector<Camera>(Split)>& camerasOf,
                   const std::function<Image(const Camera&)>& show, Report& report) {
    check(options);
    for (const Split split : {Split::train, Split::val, Split::test}) {
        const std::vector<Camera> cameras = camerasOf(split);
        if (cameras.empty()) continue;
        const std::string name = splitName(split);
        makeFolder(folder / name);
        report.begin("render " + name + " views", static_cast<std::int64_t>(cameras.size()));
        // Some views at once, so that writing one overlaps rendering the next.
        constexpr std::size_t kAtOnce = 8;
        for (std::size_t begin = 0; begin < cameras.size(); begin += kAtOnce) {
            const std::size_t n = std::min(kAtOnce, cameras.size() - begin);
            parallelFor(n, [&](std::size_t i) {
                const std::string file = "r_" + std::to_string(begin + i) + ".png";
                writeImage(folder / name / file, show(cameras[begin + i]));
            });
            report.update(static_cast<std::int64_t>(begin + n), "");
            if (report.cancelled())
                throw Interrupted("synthetic data set: stopped before its " + name + " views were done");
        }
        report.end();

        nlohmann::json transforms;
        transforms["camera_angle_x"] = 2.0 * std::atan(0.5 * options.width / cameras[0].fx);
        transforms["frames"] = nlohmann::json::array();
        for (std::size_t i = 0; i < cameras.size(); ++i)
            transforms["frames"].push_back(toJson(cameras[i], "./" + name + "/r_" + std::to_string(i)));
        writeAtomically(folder / ("transforms_" + name + ".json"), transforms.dump(4) + "\n");
    }
}

}  // namespace nerfvdb
