// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_transforms.h"

#include <Eigen/LU>
#include <cmath>
#include <functional>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/trainer/scene_folder.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

std::vector<std::string> namesOf(const Dataset& dataset) {
    std::vector<std::string> names;
    for (const View& view : dataset.views) names.push_back(view.path.stem().string());
    return names;
}

using Names = std::vector<std::string>;

}  // namespace

TEST_CASE("split files: the JSON's order, names without extension, focal length from the angle", "[trainer]") {
    SceneFolder scene(3, 4);
    scene.document.erase("w");
    scene.document.erase("h");
    scene.document.erase("fl_x");
    scene.document.erase("fl_y");
    scene.document["camera_angle_x"] = 0.6911112070083618;
    for (int i = 0; i < 3; ++i) scene.frame(i)["file_path"] = "./images/" + std::to_string(102 - i);
    scene.save("transforms_train.json");

    const Dataset train = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(namesOf(train) == Names{"102", "101", "100"});
    CHECK(train.warnings.empty());
    const Camera& camera = train.views[0].camera;
    CHECK(camera.width == 20);
    CHECK(camera.height == 10);
    CHECK(camera.fx == Approx(10 / std::tan(0.5 * 0.6911112070083618)).epsilon(1e-14));
    CHECK(camera.fy == camera.fx);
    CHECK(camera.cx == 10);
    CHECK(camera.cy == 5);
    CHECK((camera.position - ringCamera(0, 3, 20, 10).position).norm() < 1e-14);
    CHECK((camera.world_from_camera - ringCamera(0, 3, 20, 10).world_from_camera).norm() < 1e-14);

    SECTION("an absent val split falls back to test, with a warning") {
        scene.save("transforms_test.json");
        const Dataset val = readTransforms(scene.dir.path(), Split::val, true);
        CHECK(val.views.size() == 3);
        REQUIRE(val.warnings.size() == 1);
        CHECK_THAT(val.warnings[0], Contains("no transforms_val.json"));
    }
    SECTION("an absent test split is an error that says what there is") {
        CHECK_THROWS_WITH(readTransforms(scene.dir.path(), Split::test, false),
                          Contains("no test split (only train)") && Contains("transforms_test.json"));
    }
}

TEST_CASE("a split's file stands for its folder, whichever split is asked for", "[trainer]") {
    SceneFolder scene(9);
    scene.save("transforms_train.json");
    scene.document["frames"] = {scene.frame(3), scene.frame(1)};
    scene.save("transforms_test.json");
    for (const char* name : {"transforms_train.json", "transforms_test.json"}) {
        const Dataset train = readTransforms(scene.dir / name, Split::train, true);
        CHECK(train.views.size() == 9);
        CHECK(train.root == scene.dir / name);  // as the user named it
        CHECK(namesOf(readTransforms(scene.dir / name, Split::test, true)) == Names{"103", "101"});
    }
    CHECK_THROWS_AS(readTransforms(scene.dir / "transforms_val.json", Split::train, true), IoError);
}

TEST_CASE("a single file is sorted by name and every 8th existing frame is held out", "[trainer]") {
    SceneFolder scene(18);
    std::reverse(scene.document["frames"].begin(), scene.document["frames"].end());
    fs::remove(scene.dir / "images/103.png");  // so the second held-out frame is 109, not 108
    scene.document["aabb_scale"] = 4;
    scene.save();

    const Dataset test = readTransforms(scene.dir.path(), Split::test, false);
    CHECK(namesOf(test) == Names{"100", "109", "117"});
    CHECK(test.aabb_scale == 4.0);
    CHECK(namesOf(readTransforms(scene.dir.path(), Split::val, false)) == namesOf(test));
    const Dataset train = readTransforms(scene.dir / "transforms.json", Split::train, false);
    CHECK(train.views.size() == 14);
    CHECK(namesOf(train)[0] == "101");
    CHECK(namesOf(train)[2] == "104");

    REQUIRE(train.warnings.size() == 1);
    CHECK_THAT(train.warnings[0], Contains("1 of 18 frames") && Contains("103.png") && Contains("left out"));
    CHECK_THROWS_WITH(readTransforms(scene.dir.path(), Split::train, true),
                      Contains("transforms.json: frames") && Contains("1 of 18") && Contains("103.png"));
    for (int i = 104; i < 113; ++i) fs::remove(scene.dir / "images" / (std::to_string(i) + ".png"));
    CHECK_THROWS_WITH(readTransforms(scene.dir.path(), Split::train, false),
                      Contains("10 of 18") && Contains("at least half"));
    fs::copy_file(scene.dir / "images/101.png", scene.dir / "images/105.png");  // exactly half is enough
    CHECK(readTransforms(scene.dir.path(), Split::train, false).views.size() == 7);
}

TEST_CASE("paths of another machine are found in the folder, and an image with two poses is told", "[trainer]") {
    SceneFolder scene(4);
    scene.frame(0)["file_path"] = ".\\images\\100.png";
    scene.frame(1)["file_path"] = "C:\\Users\\me\\scene\\images\\101";
    scene.frame(2)["file_path"] = "/home/me/scene/images/102.png";
    scene.frame(2)["mask_path"] = "/home/me/scene/images/103.png";
    scene.frame(3)["file_path"] = "images/102.png";
    scene.save("transforms_train.json");
    const Dataset train = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(namesOf(train) == Names{"100", "101", "102", "102"});
    CHECK(train.views[2].mask_path == scene.dir / "images/103.png");
    REQUIRE(train.warnings.size() == 2);
    CHECK_THAT(train.warnings[0], Contains("2 of 4 paths lead out of the data folder") && Contains("101.png for C:\\Users\\me"));
    CHECK_THAT(train.warnings[1], Contains("1 of 4 frames") && Contains("102.png") && Contains("no photograph has two poses"));

    // A mask that is not there is no photograph of its name, and one absent image does not cost the others.
    scene.frame(2)["mask_path"] = "/home/me/masks/images/102.png";
    scene.save("transforms_train.json");
    CHECK_THROWS_WITH(readTransforms(scene.dir.path(), Split::train, true), Contains("frames[2].mask_path"));
    scene.frame(2).erase("mask_path");
    scene.frame(2)["file_path"] = "/home/me/scene/images/nothing.png";
    scene.save("transforms_train.json");
    CHECK(readTransforms(scene.dir.path(), Split::train, false).views.size() == 3);
}

TEST_CASE("depth maps and cameras that move are named once, where photographs are learned from", "[trainer]") {
    SceneFolder scene(9);
    for (int i = 0; i < 9; ++i) {
        scene.frame(i)["sharpness"] = 12.5;  // chosen by whoever wrote the file
        scene.frame(i)["rolling_shutter"] = {0, 0, 0, 0};
    }
    scene.save();
    CHECK(readTransforms(scene.dir.path(), Split::train, false).warnings.empty());

    for (const int i : {1, 2, 3}) scene.frame(i)["depth_file_path"] = "depth/" + std::to_string(i) + ".png";
    scene.frame(4)["rolling_shutter"] = {0, 0, 0.01, 0};
    scene.frame(5)["transform_matrix_end"] = scene.frame(5)["transform_matrix"];
    scene.save();
    const Dataset train = readTransforms(scene.dir.path(), Split::train, false);
    REQUIRE(train.warnings.size() == 2);
    CHECK_THAT(train.warnings[0], Contains("transforms.json: 3 of 7 frames name depth maps"));
    CHECK_THAT(train.warnings[1], Contains("2 of 7 frames were taken by a moving camera"));
    CHECK(readTransforms(scene.dir.path(), Split::test, false).warnings.empty());

    scene.document["rolling_shutter"] = {0, 0, 0.01, 0};
    scene.save();
    CHECK_THAT(readTransforms(scene.dir.path(), Split::train, false).warnings.back(), Contains("7 of 7 frames were taken"));
}

TEST_CASE("a frame's own intrinsics go over the file's", "[trainer]") {
    SceneFolder scene(9);
    scene.document["k1"] = 0.01;
    scene.document["camera_model"] = "OPENCV";
    scene.frame(2)["fl_x"] = 30.0;
    scene.frame(2)["cx"] = 9.0;
    scene.frame(2)["k1"] = 0.02;
    scene.frame(3)["camera_angle_x"] = 2 * std::atan(10.0 / 40.0);
    scene.save();
    const Dataset train = readTransforms(scene.dir.path(), Split::train, true);
    REQUIRE(train.views.size() == 7);  // frames 0 and 8 are held out

    const Camera& plain = train.views[0].camera;
    CHECK(plain.fx == 15.0);
    CHECK(plain.fy == 15.5);
    CHECK(plain.cx == 10.0);
    CHECK(plain.distortion.k1 == 0.01);
    const Camera& own = train.views[1].camera;
    CHECK(own.fx == 30.0);
    CHECK(own.fy == 15.5);
    CHECK(own.cx == 9.0);
    CHECK(own.cy == 5.0);
    CHECK(own.distortion.k1 == 0.02);
    CHECK(train.views[2].camera.fx == Approx(40.0));
}

TEST_CASE("lens models of the file and of a frame", "[trainer]") {
    SceneFolder scene(9);
    scene.document["camera_model"] = "FULL_OPENCV";
    const char* terms[] = {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"};
    for (int i = 0; i < 8; ++i) scene.document[terms[i]] = 0.001 * (i + 1);
    scene.frame(2)["camera_model"] = "OPENCV_FISHEYE";
    for (const char* term : {"k5", "k6", "p1", "p2"}) scene.frame(2)[term] = 0;
    scene.frame(3)["k4"] = 0.05;
    for (const char* term : {"k5", "k6", "p1", "p2"}) scene.frame(4)[term] = 0;
    scene.frame(4)["is_fisheye"] = true;
    scene.frame(4)["camera_model"] = "PINHOLE";  // is_fisheye knows better
    scene.save();
    const Dataset train = readTransforms(scene.dir.path(), Split::train, true);
    const Distortion& plain = train.views[0].camera.distortion;
    CHECK(plain.model == LensModel::perspective);
    CHECK(plain.k3 == 0.003);
    CHECK(plain.k4 == 0.004);
    CHECK(plain.k5 == 0.005);
    CHECK(plain.k6 == 0.006);
    CHECK(plain.p2 == 0.008);
    CHECK(train.views[1].camera.distortion.model == LensModel::fisheye);
    CHECK(train.views[1].camera.distortion.k4 == 0.004);
    CHECK(train.views[1].camera.distortion.k5 == 0);
    CHECK(train.views[2].camera.distortion.k4 == 0.05);
    CHECK(train.views[3].camera.distortion.model == LensModel::fisheye);

    // k5 makes a model rational without saying so.
    scene.document.erase("camera_model");
    CHECK_NOTHROW((scene.save(), readTransforms(scene.dir.path(), Split::train, true)));
}

TEST_CASE("masks are named, what does not matter is passed by", "[trainer]") {
    SceneFolder scene(9);
    scene.frame(2)["mask_path"] = "images/100.png";
    scene.frame(3)["depth_file_path"] = "absent.exr";
    scene.document["ply_file_path"] = "absent.ply";
    scene.document["applied_transform"] = {{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, -1, 0}};
    scene.document["applied_scale"] = 3;
    scene.save();
    const Dataset train = readTransforms(scene.dir.path(), Split::train, true);
    CHECK(train.views[0].mask_path.empty());
    CHECK(train.views[1].mask_path == scene.dir / "images/100.png");
    CHECK((train.views[1].camera.position - ringCamera(2, 9, 20, 10).position).norm() < 1e-14);
}

TEST_CASE("intrinsics follow images of another size", "[trainer]") {
    SceneFolder scene(2);
    scene.document["w"] = 41;  // half of 41 x 20 is 20 x 10 after rounding down
    scene.document["h"] = 20;
    scene.document["cx"] = 20.5;
    scene.save();
    const Camera camera = readTransforms(scene.dir.path(), Split::train, true).views[0].camera;
    CHECK(camera.width == 20);
    CHECK(camera.height == 10);
    CHECK(camera.fx == Approx(15.0 * 20 / 41));
    CHECK(camera.fy == Approx(15.5 / 2));
    CHECK(camera.cx == Approx(10));
    CHECK(camera.cy == Approx(5));

    scene.document["w"] = 20;
    scene.document["h"] = 40;
    scene.save();
    CHECK_THROWS_AS(readTransforms(scene.dir.path(), Split::train, true), DataError);
    CHECK_THROWS_WITH(readTransforms(scene.dir.path(), Split::train, true), Contains("frames[1].file_path") &&
                                                                                Contains("101.png of 20x10") &&
                                                                                Contains("expected 20x40"));
}

TEST_CASE("the file's own lists of names decide the split", "[trainer]") {
    SceneFolder scene(5);
    scene.document["train_filenames"] = {"images/104.png", "images/100.png", "images/101.png"};
    scene.document["test_filenames"] = {"images/102.png"};
    scene.save();
    CHECK(namesOf(readTransforms(scene.dir.path(), Split::train, true)) == Names{"100", "101", "104"});
    CHECK(namesOf(readTransforms(scene.dir.path(), Split::test, true)) == Names{"102"});
    const Dataset val = readTransforms(scene.dir.path(), Split::val, true);
    CHECK(namesOf(val) == Names{"102"});
    CHECK(val.warnings.size() == 1);
}

TEST_CASE("a rotation that was rounded on its way is made one again", "[trainer]") {
    SceneFolder scene(2);
    for (auto& row : scene.frame(1)["transform_matrix"])
        for (auto& value : row) value = std::round(value.get<double>() * 1e4) / 1e4;
    scene.save();
    const Mat3d r = readTransforms(scene.dir.path(), Split::train, true).views[0].camera.world_from_camera;
    CHECK((r.transpose() * r - Mat3d::Identity()).cwiseAbs().maxCoeff() < 1e-15);
    CHECK((r - ringCamera(1, 2, 20, 10).world_from_camera).cwiseAbs().maxCoeff() < 1e-4);
}

TEST_CASE("what makes no camera is named by file and field", "[trainer]") {
    struct Case {
        std::string what;
        std::function<void(SceneFolder&)> spoil;
        std::vector<std::string> message;
    };
    const auto matrix = [](SceneFolder& s) -> nlohmann::json& { return s.frame(1)["transform_matrix"]; };
    const Case cases[] = {
        {"NaN",
         [&](SceneFolder& s) { matrix(s)[0][3] = "NaN"; },
         {"frames[1].transform_matrix[0][3]", "finite"}},
        {"scaled",
         [&](SceneFolder& s) { matrix(s)[0][0] = matrix(s)[0][0].get<double>() + 2; },
         {"frames[1].transform_matrix", "not rigid"}},
        {"mirrored",
         [&](SceneFolder& s) {
             for (int r = 0; r < 3; ++r) matrix(s)[r][0] = -matrix(s)[r][0].get<double>();
         },
         {"frames[1].transform_matrix", "mirror"}},
        {"short row",
         [&](SceneFolder& s) {
             matrix(s)[1] = {1, 2, 3};
         },
         {"transform_matrix[1]", "3 numbers"}},
        {"rows",
         [&](SceneFolder& s) {
             matrix(s) = {1, 2};
         },
         {"transform_matrix", "2 rows"}},
        {"projective",
         [&](SceneFolder& s) {
             matrix(s)[3] = {0, 0, 0, 2};
         },
         {"transform_matrix[3]", "0 0 0 1"}},
        {"no matrix",
         [](SceneFolder& s) { s.frame(1).erase("transform_matrix"); },
         {"frames[1]", "no key 'transform_matrix'"}},
        {"no file_path",
         [](SceneFolder& s) { s.frame(1).erase("file_path"); },
         {"frames[1]", "no key 'file_path'"}},
        {"no frames", [](SceneFolder& s) { s.document.erase("frames"); }, {"no key 'frames'"}},
        {"frames is no list",
         [](SceneFolder& s) { s.document["frames"] = 3; },
         {"frames: found 3", "an array"}},
        {"empty",
         [](SceneFolder& s) { s.document["frames"] = nlohmann::json::array(); },
         {"frames", "no frame for the train split (0 listed)"}},
        {"only one frame, which is held out",
         [](SceneFolder& s) { s.document["frames"].erase(1); },
         {"no frame for the train split (1 listed)"}},
        {"zero focal length", [](SceneFolder& s) { s.document["fl_x"] = 0; }, {"fl_x: found 0", "above zero"}},
        {"no focal length",
         [](SceneFolder& s) {
             s.document.erase("fl_x");
             s.document.erase("fl_y");
         },
         {"frames[1]", "no focal length", "camera_angle_x"}},
        {"angle", [](SceneFolder& s) { s.document["camera_angle_x"] = 44.0; }, {"camera_angle_x", "radians"}},
        {"text for a number", [](SceneFolder& s) { s.document["cx"] = "ten"; }, {"cx: found \"ten\""}},
        {"negative size", [](SceneFolder& s) { s.document["w"] = -20; }, {"w: found -20"}},
        {"panorama",
         [](SceneFolder& s) { s.document["camera_model"] = "EQUIRECTANGULAR"; },
         {"camera_model: found 'EQUIRECTANGULAR'", "OPENCV_FISHEYE", "undistort"}},
        {"a frame's panorama",
         [](SceneFolder& s) { s.frame(1)["camera_model"] = "VR180_L"; },
         {"frames[1].camera_model"}},
        {"fisheye with p1",
         [](SceneFolder& s) {
             s.document["is_fisheye"] = true;
             s.document["p1"] = 0.1;
         },
         {"frames[1]", "fisheye lens with p1"}},
        {"fisheye with an angle",
         [](SceneFolder& s) {
             s.document["camera_model"] = "OPENCV_FISHEYE";
             s.frame(1)["camera_angle_x"] = 1.0;
             s.frame(1)["camera_angle_y"] = 1.0;
         },
         {"frames[1]", "without fl_x"}},
        {"upward mask",
         [](SceneFolder& s) { s.frame(1)["mask_path"] = "../mask.png"; },
         {"frames[1].mask_path", "inside the data folder"}},
        {"absent mask",
         [](SceneFolder& s) { s.frame(1)["mask_path"] = "masks/101.png"; },
         {"frames[1].mask_path", "no file", "masks/101.png"}},
        {"fourth term", [](SceneFolder& s) { s.document["k4"] = 0.1; }, {"frames[1]", "k4", "FULL_OPENCV"}},
        {"folding lens", [](SceneFolder& s) { s.document["k1"] = -3.0; }, {"frames[1]", "folds"}},
        {"upward",
         [](SceneFolder& s) { s.frame(1)["file_path"] = "images/../../secret.png"; },
         {"no frame for the train split (2 listed)"}},  // the other is held out
        {"absolute",
         [](SceneFolder& s) { s.frame(1)["file_path"] = "/etc/passwd"; },
         {"no frame for the train split"}},
        {"no name", [](SceneFolder& s) { s.frame(1)["file_path"] = ".."; }, {"frames[1].file_path", "inside the data folder"}},
        {"aabb_scale", [](SceneFolder& s) { s.document["aabb_scale"] = 0; }, {"aabb_scale: found 0"}},
    };
    for (const Case& c : cases) {
        CAPTURE(c.what);
        SceneFolder scene(2);
        c.spoil(scene);
        scene.save();
        try {
            readTransforms(scene.dir.path(), Split::train, false);
            FAIL("no error");
        } catch (const DataError& error) {
            CHECK_THAT(error.what(), Contains("transforms.json"));
            for (const std::string& part : c.message) CHECK_THAT(error.what(), Contains(part));
        }
    }
}

TEST_CASE("where poses are not checked, those that no camera can have come as they are written", "[trainer]") {
    SceneFolder scene(4);
    for (int r = 0; r < 3; ++r) {
        nlohmann::json& value = scene.frame(1)["transform_matrix"][static_cast<std::size_t>(r)][0];
        value = -value.get<double>();
    }
    scene.save();
    CHECK_THROWS_AS(readTransforms(scene.dir.path(), Split::train, false), DataError);
    const Dataset dataset = readTransforms(scene.dir.path(), Split::train, false, /*check_poses=*/false);
    REQUIRE(dataset.views.size() == 3);
    CHECK(dataset.views[0].camera.world_from_camera.determinant() == Approx(-1));
    CHECK(dataset.views[1].camera.world_from_camera.determinant() == Approx(1));
}

TEST_CASE("a path that is no data set is refused", "[trainer]") {
    const TempDir dir;
    CHECK_THROWS_AS(readTransforms(dir / "absent", Split::train, false), IoError);
    CHECK_THROWS_WITH(readTransforms(dir.path(), Split::train, false), Contains("no transforms.json"));
    CHECK_FALSE(hasTransforms(dir.path()));
    SceneFolder scene(2);
    CHECK_FALSE(hasTransforms(scene.dir.path()));
    scene.save("transforms_test.json");
    CHECK(hasTransforms(scene.dir.path()));
    CHECK(hasTransforms(scene.dir / "transforms_test.json"));
}
