// SPDX-License-Identifier: Apache-2.0
#include "cli/camera_path.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

/// A file that goes away with the test.
class TextFile {
public:
    explicit TextFile(const std::string& text)
        : path_(std::filesystem::temp_directory_path() / "nerfvdb_camera_path_test.json") {
        std::ofstream(path_) << text;
    }
    ~TextFile() { std::filesystem::remove(path_); }
    const std::filesystem::path& path() const { return path_; }

private:
    std::filesystem::path path_;
};

const std::string kPose = "[1,0,0,10, 0,1,0,20, 0,0,1,30, 0,0,0,1]";

}  // namespace

TEST_CASE("a camera path gives poses row by row, and vertical degrees", "[cli]") {
    const TextFile file(
        R"({"camera_type": "perspective", "render_width": 640, "render_height": 480, "camera_path": [
        {"camera_to_world": )" +
        kPose + R"(, "fov": 90, "aspect": 1.33}]})");
    const auto cameras = readCameraPath(file.path(), {});
    REQUIRE(cameras.size() == 1);
    const Camera& camera = cameras.front();
    CHECK(camera.width == 640);
    CHECK(camera.height == 480);
    CHECK(camera.fy == Approx(240));  // half the height over tan 45 degrees
    CHECK(camera.position == Vec3d(10, 20, 30));
    const Ray centre = cameraRay(camera, 320, 240);
    CHECK((centre.direction - Vec3d(0, 0, -1)).norm() < 1e-12);

    PictureSize size;
    size.width = 64;
    size.height = 48;
    size.fov_y_rad = 60 * std::numbers::pi / 180;
    const Camera other = readCameraPath(file.path(), size).front();
    CHECK(other.width == 64);
    CHECK(other.fy == Approx(24 / std::tan(std::numbers::pi / 6)));
}

TEST_CASE("a bad camera path names file and field", "[cli]") {
    const auto message = [](const std::string& text) -> std::string {
        const TextFile file(text);
        try {
            readCameraPath(file.path(), {});
        } catch (const DataError& error) {
            return error.what();
        }
        return "";
    };
    using Catch::Matchers::Contains;
    CHECK_THAT(message("{"), Contains("nerfvdb_camera_path_test.json") && Contains("line 1, column 2"));
    CHECK_THAT(message("[]"), Contains("camera_path"));
    CHECK_THAT(message(R"({"camera_path": []})"), Contains("empty"));
    CHECK_THAT(message(R"({"camera_path": [{}]})"), Contains("render_width"));
    const std::string head = R"({"render_width": 8, "render_height": 8, )";
    CHECK_THAT(message(head + R"("camera_type": "fisheye", "camera_path": [{}]})"), Contains("fisheye"));
    CHECK_THAT(message(head + R"("camera_path": [{"fov": 50}]})"),
               Contains("camera_path[0]: found no key 'camera_to_world'"));
    const std::string with_nan = "[1,0,0,NaN, 0,1,0,20, 0,0,1,30, 0,0,0,1]";
    CHECK_THAT(message(head + R"("camera_path": [{"fov": 50, "camera_to_world": )" + with_nan + "}]}"),
               Contains("camera_path[0].camera_to_world[3]: found \"NaN\""));
    CHECK_THAT(message(head + R"("camera_path": [{"camera_to_world": )" + kPose + "}]}"), Contains("fov"));
    CHECK_THAT(message(head + R"("camera_path": [{"fov": 180, "camera_to_world": )" + kPose + "}]}"),
               Contains("between 0 and 180"));
    const std::string scaled = "[2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]";
    CHECK_THAT(message(head + R"("camera_path": [{"fov": 50, "camera_to_world": )" + scaled + "}]}"),
               Contains("camera_path[0]"));
}

TEST_CASE("an orbit sees the whole box from every side", "[cli]") {
    const Box box{{-1, 0, 2}, {3, 1, 5}};
    for (const UpAxis up : {UpAxis::y, UpAxis::z}) {
        PictureSize size;
        size.width = 320;
        size.height = 200;
        const auto cameras = orbitCameras(box, 5, up, size);
        REQUIRE(cameras.size() == 5);
        for (const Camera& camera : cameras) {
            CHECK(cameraProblem(camera).empty());
            for (int corner = 0; corner < 8; ++corner) {
                const Vec3d point(corner & 1 ? box.max.x() : box.min.x(),
                                  corner & 2 ? box.max.y() : box.min.y(),
                                  corner & 4 ? box.max.z() : box.min.z());
                const auto pixel = projectPoint(camera, point);
                REQUIRE(pixel);
                CHECK((pixel->x() >= 0 && pixel->x() <= 320 && pixel->y() >= 0 && pixel->y() <= 200));
            }
            // Up in the world is up in the picture.
            const Vec3d axis = up == UpAxis::z ? Vec3d::UnitZ() : Vec3d::UnitY();
            CHECK(projectPoint(camera, box.center() + 0.1 * axis)->y() < 100);
            CHECK(camera.position.dot(axis) > box.center().dot(axis));
        }
    }
}
