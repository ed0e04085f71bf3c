// SPDX-License-Identifier: Apache-2.0
#include "trainer/write_dataset.h"

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/image.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "trainer/exact_ray.h"

using namespace nerfvdb;

namespace {

SyntheticDatasetOptions small() {
    SyntheticDatasetOptions options;
    options.train_views = 5, options.val_views = 2, options.test_views = 3;
    options.width = 40, options.height = 30;
    return options;
}

std::map<std::string, std::string> filesUnder(const std::filesystem::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
        if (entry.is_regular_file())
            files[std::filesystem::relative(entry.path(), folder).string()] = readFile(entry.path());
    return files;
}

struct CancelledReport : Report {
    bool cancelled() const override { return true; }
};

}  // namespace

TEST_CASE("a synthetic data set has NeRF-synthetic's layout and the exact colours", "[write_dataset]") {
    const TempDir folder;
    const auto scene = makeSyntheticScene("glossy");
    Report report;
    writeSyntheticDataset(*scene, folder / "new" / "set", small(), report);

    const std::map<std::string, int> splits = {{"train", 5}, {"val", 2}, {"test", 3}};
    for (const auto& [name, views] : splits) {
        INFO(name);
        const auto root = folder / "new" / "set";
        const auto json = nlohmann::json::parse(readFile(root / ("transforms_" + name + ".json")));
        REQUIRE(json.at("frames").size() == static_cast<std::size_t>(views));
        const double focal = 0.5 * 40 / std::tan(0.5 * json.at("camera_angle_x").get<double>());
        for (int i = 0; i < views; ++i) {
            const auto& frame = json["frames"][i];
            CHECK(frame.at("file_path") == "./" + name + "/r_" + std::to_string(i));
            // The camera as a reader would build it from the file.
            Camera camera;
            camera.width = 40, camera.height = 30, camera.fx = camera.fy = focal, camera.cx = 20,
            camera.cy = 15;
            const auto& m = frame.at("transform_matrix");
            for (int r = 0; r < 3; ++r) {
                for (int c = 0; c < 3; ++c) camera.world_from_camera(r, c) = m[r][c];
                camera.position[r] = m[r][3];
            }
            CHECK(cameraProblem(camera) == "");
            const Photo photo = readPhoto(root / name / ("r_" + std::to_string(i) + ".png"));
            REQUIRE((photo.width == 40 && photo.height == 30 && photo.has_alpha));
            double worst = 0;
            for (int p = 0; p < 40 * 30; ++p) {
                const RayColour light = exactRay(*scene, cameraRay(camera, p % 40 + 0.5, p / 40 + 0.5));
                const auto& pixel = photo.pixels[p];
                worst = std::max(worst, std::abs(pixel[3] - 255 * light.opacity));
                if (pixel[3] == 0) continue;
                for (int c = 0; c < 3; ++c)
                    worst = std::max(worst, std::abs(pixel[c] - 255 * light.rgb[c] / light.opacity));
            }
            // Half a level of rounding; a little more because the pose went through rounded trigonometry.
            CHECK(worst < 0.501);
        }
    }
}

TEST_CASE("equal seeds give equal bytes on any number of threads; other seeds other cameras",
          "[write_dataset]") {
    const TempDir folder;
    const auto scene = makeSyntheticScene("fog");
    Report report;
    writeSyntheticDataset(*scene, folder / "a", small(), report);
    {
        const ThreadLimit one(1);
        writeSyntheticDataset(*scene, folder / "b", small(), report);
    }
    const auto a = filesUnder(folder / "a");
    CHECK(a.size() == 13);
    CHECK((a == filesUnder(folder / "b")));
    SyntheticDatasetOptions other = small();
    other.seed = 2;
    writeSyntheticDataset(*scene, folder / "c", other, report);
    CHECK(a.at("transforms_train.json") != filesUnder(folder / "c").at("transforms_train.json"));
}

TEST_CASE("cameras look at the scene from all around, and tests do not repeat training views",
          "[write_dataset]") {
    const SyntheticDatasetOptions options;
    const auto train = syntheticCameras(Split::train, options), test = syntheticCameras(Split::test, options);
    REQUIRE(train.size() == 60);
    REQUIRE(test.size() == 20);
    double lowest = 10, highest = -10, nearest = 10;
    for (const Camera& camera : train) {
        CHECK(cameraProblem(camera) == "");
        const auto centre = projectPoint(camera, Vec3d::Zero());
        REQUIRE(centre.has_value());
        CHECK((*centre - Vec2d(100, 100)).norm() < 1e-9);
        lowest = std::min(lowest, camera.position.z());
        highest = std::max(highest, camera.position.z());
        for (const Camera& other : test)
            nearest = std::min(nearest, (camera.position - other.position).norm() / camera.position.norm());
    }
    CHECK(lowest < 0);
    CHECK(highest > 3.9);
    CHECK(nearest > 0.005);  // radians, roughly
}

TEST_CASE("absurd options, a folder that is a file, and a request to stop", "[write_dataset]") {
    const TempDir folder;
    const auto scene = makeSyntheticScene("sphere");
    Report report;
    SyntheticDatasetOptions options = small();
    options.width = 0;
    REQUIRE_THROWS_AS(writeSyntheticDataset(*scene, folder / "x", options, report), UsageError);
    options = small();
    options.train_views = -1;
    REQUIRE_THROWS_WITH(writeSyntheticDataset(*scene, folder / "x", options, report),
                        Catch::Contains("train views") && Catch::Contains("-1"));
    CHECK_FALSE(std::filesystem::exists(folder / "x"));

    std::ofstream(folder / "file") << "not a folder";
    REQUIRE_THROWS_AS(writeSyntheticDataset(*scene, folder / "file", small(), report), IoError);
    CHECK(readFile(folder / "file") == "not a folder");

    CancelledReport impatient;
    REQUIRE_THROWS_AS(writeSyntheticDataset(*scene, folder / "y", small(), impatient), Interrupted);
    CHECK_FALSE(std::filesystem::exists(folder / "y" / "transforms_train.json"));

    options = small();
    options.val_views = 0;
    writeSyntheticDataset(*scene, folder / "z", options, report);
    CHECK_FALSE(std::filesystem::exists(folder / "z" / "transforms_val.json"));
    CHECK(std::filesystem::exists(folder / "z" / "transforms_test.json"));
}
