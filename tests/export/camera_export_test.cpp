// SPDX-License-Identifier: Apache-2.0
#include "export/camera_export.h"

#include <cstdlib>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/image.h"
#include "export/placement.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "trainer/read_transforms.h"

using namespace nerfvdb;
using Catch::Matchers::Contains;

namespace {

/// Five views of different lenses and sizes, the last two held out.
std::vector<ModelCamera> someCameras() {
    std::vector<ModelCamera> cameras;
    for (int i = 0; i < 5; ++i) {
        ModelCamera entry;
        entry.name = "photos/view " + std::to_string(i) + ".png";
        entry.camera = lookAt({3, 0.4 * i - 1, 1.5}, {0.1, 0.2, 0.3}, Vec3d::UnitZ(), 0.6 + 0.1 * i, 40 + 2 * i, 30);
        entry.camera.fx *= 1 + 0.03 * i;
        entry.camera.cx += 1.25 * i;
        entry.camera.cy -= 0.75 * i;
        if (i == 1) entry.camera.distortion = {0.02, -0.01, 0.001, 1e-3, -2e-3};
        if (i == 2) entry.camera.distortion = {0.1, 0.02, 0.003, 1e-4, -2e-4, 0.11, 0.01, 0.001};
        if (i == 4) entry.camera.distortion = {0.1, 0.02, 0.003, 0, 0, -0.001, 0, 0, LensModel::fisheye};
        entry.held_out = i > 2;
        cameras.push_back(entry);
    }
    return cameras;
}

void writePhotos(const std::filesystem::path& folder, std::span<const ModelCamera> cameras) {
    std::filesystem::create_directory(folder / "photos");
    for (const ModelCamera& entry : cameras)
        writeImage(folder / entry.name, Image(entry.camera.width, entry.camera.height, 3));
}

}  // namespace

TEST_CASE("exported cameras read as a data set whose pictures are the same") {
    const TempDir folder;
    const std::vector<ModelCamera> cameras = someCameras();
    writePhotos(folder.path(), cameras);
    const Similarity placement = placementOf(
        {.scale = 2.5, .up = UpAxis::y, .origin = PlacementOptions::Origin::ground}, {{-1, -2, -3}, {4, 5, 6}});
    writeCamerasJson(folder / "volume.cameras.json", cameras, placement);

    const Dataset train = readTransforms(folder / "volume.cameras.json", Split::train, /*strict=*/true);
    const Dataset test = readTransforms(folder / "volume.cameras.json", Split::test, /*strict=*/true);
    REQUIRE(train.views.size() == 3);
    REQUIRE(test.views.size() == 2);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        const View& view = i < 3 ? train.views[i] : test.views[i - 3];
        CHECK(view.path == folder / cameras[i].name);
        CHECK(view.camera.width == cameras[i].camera.width);
        for (const Vec3d& point : {Vec3d(0, 0, 0), Vec3d(0.5, -0.3, 0.9), Vec3d(-1, 0.7, 0.2)}) {
            const auto before = projectPoint(cameras[i].camera, point);
            const auto after = projectPoint(view.camera, placement.apply(point));
            REQUIRE(before);
            REQUIRE(after);
            CHECK((*before - *after).norm() < 1e-10);  // pixels; JSON's numbers are exact
        }
    }
    const std::string json = readFile(folder / "volume.cameras.json");
    CHECK_THAT(json, Contains("\"warning\": \"photographs were taken with a fisheye lens (OPENCV_FISHEYE), which the pinholes"));
    CHECK(json.find("\"camera_model\": \"OPENCV\"") < json.find("\"frames\""));
    CHECK(json.find("\"camera_model\": \"OPENCV_FISHEYE\"") > json.find("\"camera_model\": \"FULL_OPENCV\""));
    CHECK_THAT(json, Contains("\"exported_from_model\""));

    writeCamerasJson(folder / "again.json", cameras, placement);
    CHECK(readFile(folder / "again.json") == json);
}

TEST_CASE("cameras without distortion, names or held-out views leave out what does not apply") {
    const TempDir folder;
    std::vector<ModelCamera> cameras = someCameras();
    cameras.resize(3);
    writeCamerasJson(folder / "distorted.json", cameras, {});
    CHECK_THAT(readFile(folder / "distorted.json"), Contains("\"warning\": \"photographs have lens distortion"));
    cameras[1].camera.distortion = cameras[2].camera.distortion = {};
    writeCamerasJson(folder / "a.json", cameras, {});
    CHECK_THAT(readFile(folder / "a.json"), !Contains("warning") && Contains("train_filenames"));
    CHECK_THAT(readFile(folder / "a.json"), !Contains("test_filenames"));
    cameras[2].name.clear();
    writeCamerasJson(folder / "b.json", cameras, {});
    CHECK_THAT(readFile(folder / "b.json"), !Contains("train_filenames"));
    CHECK_THROWS_AS(writeCamerasJson(folder / "absent" / "c.json", cameras, {}), IoError);
}

TEST_CASE("the Blender script knows the files beside it") {
    const TempDir folder;
    const BlenderScene scene{.volumes = {"it's a \"volume\".vdb", "b\\2.vdb"},
                             .cameras = "ä.cameras.json",
                             .density_name = "density",
                             .color_name = "Cd",
                             .up = UpAxis::y};
    writeBlenderScript(folder / "scene.blender.py", scene);
    const std::string script = readFile(folder / "scene.blender.py");
    CHECK_THAT(script, Contains("# SPDX-License-Identifier") && Contains("\"Cd\"") && !Contains("SCENE = None"));
    CHECK(script.find("\nmain()\n") == script.size() - 8);

    if (std::system("python3 -c pass > /dev/null 2>&1") == 0) {
        writeAtomically(folder / "check.py", R"(import ast, sys
tree = ast.parse(open(sys.argv[1], encoding='utf-8').read())
scene, = [ast.literal_eval(line.value) for line in tree.body
          if isinstance(line, ast.Assign) and line.targets[0].id == 'SCENE']
assert scene == {'volumes': ['it\'s a "volume".vdb', 'b\\2.vdb'], 'cameras': 'ä.cameras.json',
                 'density': 'density', 'color': 'Cd', 'up': 'y'}, scene
)");
        const std::string command =
            "python3 " + (folder / "check.py").string() + " " + (folder / "scene.blender.py").string();
        CHECK(std::system(command.c_str()) == 0);
    }
    for (const char* name : {"", "folder/volume.vdb", "/volume.vdb", "volume.vdb/"})
        CHECK_THROWS_AS(writeBlenderScript(folder / "bad.py", {.volumes = {name}}), UsageError);
    CHECK_THROWS_AS(writeBlenderScript(folder / "bad.py", {.volumes = {"\xff.vdb"}}), UsageError);
    CHECK_THROWS_AS(writeBlenderScript(folder / "bad.py", {}), UsageError);
    CHECK_FALSE(std::filesystem::exists(folder / "bad.py"));
}
