// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_colmap.h"

#include <cmath>
#include <functional>
#include <set>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/trainer/colmap_scene.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<std::string> namesOf(const Dataset& dataset) {
    std::vector<std::string> names;
    for (const View& view : dataset.views) names.push_back(view.path.stem().string());
    return names;
}
using Names = std::vector<std::string>;

/// Greatest distance in pixels from where images show points to where the data set's cameras put them, and from the
/// points to the rays through those pixels, in pixels too. Of images as large as stated.
double worstError(const ColmapScene& scene, const Dataset& dataset) {
    double worst = 0;
    int n_seen = 0;
    for (const View& view : dataset.views)
        for (const ColmapImage& image : scene.images) {
            if (fs::path(image.name).filename() != view.path.filename()) continue;
            for (const ColmapObservation& seen : image.observations) {
                const Vec3d point = scene.points[(seen.point - 100) / 3].position;
                const auto pixel = projectPoint(view.camera, point);
                REQUIRE(pixel);
                const Ray ray = cameraRay(view.camera, seen.pixel.x(), seen.pixel.y());
                const Vec3d offset = point - ray.origin;
                const double aside = (offset - offset.dot(ray.direction) * ray.direction).norm() / offset.norm();
                worst = std::max({worst, (*pixel - seen.pixel).norm(), aside * view.camera.fx});
                ++n_seen;
            }
        }
    REQUIRE(n_seen == 20 * static_cast<int>(dataset.views.size()));
    return worst;
}

}  // namespace

TEST_CASE("rays of a COLMAP model meet its points, in binary and in text", "[trainer]") {
    struct Case {
        const char* model;
        std::vector<double> parameters;
    };
    const Case cases[] = {
        {"OPENCV", {31, 30, 20.5, 9.5, 0.05, -0.02, 0.001, -0.002}},
        {"FULL_OPENCV", {31, 30, 20.5, 9.5, 0.05, -0.02, 0.001, -0.002, 0.01, 0.04, 0.01, -0.003}},
        {"OPENCV_FISHEYE", {28, 27, 20.5, 9.5, 0.05, -0.02, 0.01, -0.002}},
        {"RADIAL", {31, 20.5, 9.5, 0.05, -0.02}}};
    for (const Case& c : cases) {
        CAPTURE(c.model);
        const ColmapScene scene(c.model, c.parameters);
        scene.savePhotos();
        const bool is_text = GENERATE(false, true);
        is_text ? scene.saveText() : scene.saveBinary();
        REQUIRE(hasColmap(scene.dir.path()));
        const Dataset train = readColmap(scene.dir.path(), Split::train, true);
        const Dataset test = readColmap(scene.dir.path(), Split::test, true);
        CHECK(namesOf(test) == Names{"100", "108", "116"});
        CHECK(train.views.size() == 15);
        CHECK(namesOf(train)[0] == "101");
        CHECK(worstError(scene, train) < 1e-9);
        CHECK(worstError(scene, test) < 1e-9);
        CHECK(train.warnings.empty());
        CHECK(train.points.size() == 40);
        CHECK(train.points[7] == scene.points[7].position);
        // The ring's first camera stands at (3, 0, 1), upright: +y of its frame is up.
        CHECK((test.views[0].camera.position - Vec3d(3, 0, 1)).norm() < 1e-12);
        CHECK(test.views[0].camera.world_from_camera.col(1).z() > 0.9);
        CHECK(test.views[0].camera.world_from_camera.col(2).dot(Vec3d(3, 0, 1)) > 3);
        CHECK(namesOf(readColmap(scene.dir.path(), Split::val, true)) == namesOf(test));
    }
}

TEST_CASE("a model is found where tools put it", "[trainer]") {
    for (const char* place : {"sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse/3", "."}) {
        CAPTURE(place);
        const ColmapScene scene;
        scene.savePhotos();
        CHECK_FALSE(hasColmap(scene.dir.path()));
        scene.saveText(place);
        CHECK(hasColmap(scene.dir.path()));
        CHECK(readColmap(scene.dir.path(), Split::train, true).views.size() == 15);
    }
    CHECK_FALSE(hasColmap("/nowhere/at/all"));
}

TEST_CASE("of several models the one with the most images is taken, and named", "[trainer]") {
    ColmapScene scene;
    scene.savePhotos();
    scene.saveBinary("sparse/2");
    scene.images.resize(4);
    scene.saveBinary("sparse/0");
    scene.images.resize(2);
    scene.saveText("sparse/10");
    const Dataset train = readColmap(scene.dir.path(), Split::train, true);
    CHECK(train.views.size() == 15);
    REQUIRE(train.warnings.size() == 1);
    CHECK_THAT(train.warnings[0], Contains("3 models: sparse/0 (4 images), sparse/10 (2 images), sparse/2 (18 images); "
                                           "sparse/2 is used"));
}

TEST_CASE("lenses follow images of another size, in another folder and format", "[trainer]") {
    const ColmapScene scene;
    scene.saveBinary();
    scene.savePhotos("images_4", 10, 5);
    for (const ColmapImage& image : scene.images) {
        const fs::path png = scene.dir / "images_4" / image.name;
        fs::rename(png, fs::path(png).replace_extension(".PNG"));
    }
    const Dataset test = readColmap(scene.dir.path(), Split::test, true);
    CHECK(test.views[0].camera.width == 10);
    CHECK(test.views[0].camera.height == 5);
    CHECK(test.views[0].camera.fx == 7.5);
    CHECK(test.views[0].camera.cx == 5);
    CHECK(test.views[0].path.extension() == ".PNG");

    scene.savePhotos("images_2", 20, 11);  // rounded up: still of the same aspect
    CHECK(readColmap(scene.dir.path(), Split::test, true).views[0].camera.height == 11);
    scene.savePhotos("images", 20, 40);
    CHECK_THROWS_WITH(readColmap(scene.dir.path(), Split::test, true),
                      Contains("images.bin: image 50") && Contains("100.png of 20x40") && Contains("expected 40x20"));
}

TEST_CASE("absent images, images without a pose and useless points are left out, with a warning", "[trainer]") {
    ColmapScene scene;
    scene.savePhotos();
    scene.points[0].position.y() = HUGE_VAL;
    scene.points[1].position.z() = kNaN;
    scene.points[3].position.x() = 1e30;
    scene.points[2].track_length = 1;
    scene.saveBinary();
    fs::remove(scene.dir / "images/walk/103.png");
    writeImage(scene.dir / "images/walk/100b.png", Image(40, 20, 3));
    writeImage(scene.dir / "images/zero.jpg", Image(40, 20, 3));
    writeAtomically(scene.dir / "images/notes.txt", "none of them");

    const Dataset test = readColmap(scene.dir.path(), Split::test, false);
    CHECK(namesOf(test) == Names{"100", "109", "117"});  // every 8th of those that exist
    REQUIRE(test.warnings.size() == 3);
    CHECK_THAT(test.warnings[0], Contains("images.bin") && Contains("1 of 18 frames") && Contains("103.png"));
    CHECK_THAT(test.warnings[1], Contains("2 of 19 images have no pose (first: 100b.png)"));
    CHECK_THAT(test.warnings[2], Contains("points3D.bin: 3 of 40 points are not finite, or"));
    CHECK(test.points.size() == 36);
    CHECK_THROWS_WITH(readColmap(scene.dir.path(), Split::test, true), Contains("103.png") && Contains("--strict"));
    for (int i = 104; i < 113; ++i) fs::remove(scene.dir / "images/walk" / (std::to_string(i) + ".png"));
    CHECK_THROWS_WITH(readColmap(scene.dir.path(), Split::test, false), Contains("10 of 18") && Contains("at least half"));
    fs::remove_all(scene.dir / "images");
    CHECK_THROWS_WITH(readColmap(scene.dir.path(), Split::test, false), Contains("no folder 'images'"));
}

TEST_CASE("a model's images are found by the ends of other machines' paths, and only inside of the data folder", "[trainer]") {
    ColmapScene scene;
    scene.savePhotos();
    scene.images[1].name = "/home/me/garden/walk/101.png";
    scene.images[2].name = "C:\\garden\\walk\\102.png";
    scene.images[3].name = "../../secret.png";
    scene.images[4].name = "walk/../../secret.png";
    scene.images[5].name = "/etc/passwd";
    writeImage(scene.dir / "secret.png", Image(40, 20, 3));
    scene.saveBinary();
    const Dataset train = readColmap(scene.dir.path(), Split::train, false);
    REQUIRE(train.warnings.size() == 3);
    CHECK_THAT(train.warnings[0], Contains("3 of 18 frames without an image") && Contains("which leads out of the data folder"));
    CHECK_THAT(train.warnings[1], Contains("2 of 15 paths lead out of the data folder"));
    CHECK_THAT(train.warnings[2], Contains("3 of 18 images have no pose (first: 103.png)"));
    std::set<fs::path> paths;
    for (const Split split : {Split::train, Split::test})
        for (const View& view : readColmap(scene.dir.path(), split, false).views) paths.insert(view.path);
    CHECK(paths.count(scene.dir / "images/walk/101.png") == 1);
    CHECK(paths.count(scene.dir / "images/walk/102.png") == 1);
    CHECK(paths.count(scene.dir / "secret.png") == 0);
    CHECK(paths.size() == 15);
}

TEST_CASE("a model that does not fit its own points is warned of", "[trainer]") {
    ColmapScene scene;
    scene.savePhotos();
    scene.saveBinary();
    const auto errorIn = [&] {
        const fs::path folder = scene.dir / "sparse/0";
        return reprojectionError(readColmapCameras(folder), readColmapImages(folder), readColmapPoints(folder));
    };
    CHECK(errorIn().value() < 1e-9);
    for (ColmapCamera& camera : scene.cameras) camera.parameters[camera.model == "SIMPLE_RADIAL" ? 1 : 2] += 6;
    scene.saveBinary();
    CHECK(errorIn().value() == Approx(6).epsilon(1e-6));
    REQUIRE(readColmap(scene.dir.path(), Split::train, true).warnings.size() == 1);
    CHECK_THAT(readColmap(scene.dir.path(), Split::train, true).warnings[0], Contains("6.0") && Contains("not of one model"));
    scene.points.clear();
    scene.saveBinary();
    CHECK_FALSE(errorIn());
    CHECK(readColmap(scene.dir.path(), Split::train, true).points.empty());
}

TEST_CASE("what makes no data set is named by file and entry", "[trainer]") {
    struct Case {
        std::string what;
        std::function<void(ColmapScene&)> spoil;
        std::vector<std::string> message;
    };
    const Case cases[] = {
        {"zero quaternion", [](ColmapScene& s) { s.images[1].rotation = {}; },
         {"images.bin: image 49", "the quaternion 0.000000 0.000000", "length 1"}},
        {"NaN quaternion", [](ColmapScene& s) { s.images[1].rotation[2] = kNaN; }, {"image 49", "nan"}},
        {"huge quaternion", [](ColmapScene& s) { s.images[1].rotation[2] = 1e300; }, {"image 49", "quaternion"}},
        {"scaled quaternion", [](ColmapScene& s) { for (double& v : s.images[1].rotation) v *= 1.1; }, {"quaternion"}},
        {"NaN translation", [](ColmapScene& s) { s.images[1].translation.y() = kNaN; }, {"image 49", "translation"}},
        {"unknown camera", [](ColmapScene& s) { s.images[1].camera = 4; },
         {"image 49: found camera 4", "cameras.bin has", "copy all of one"}},
        {"no cameras", [](ColmapScene& s) { s.cameras.clear(); }, {"found camera", "cameras.bin"}},
        {"no images", [](ColmapScene& s) { s.images.clear(); }, {"images.bin", "no registered image"}},
        {"one image, held out", [](ColmapScene& s) { s.images.resize(1); }, {"no frame for the train split (1 listed)"}},
        {"twice the id", [](ColmapScene& s) { s.images[2].id = s.images[1].id; }, {"two entries with the id 49"}},
        {"twice the camera", [](ColmapScene& s) { s.cameras[1].id = 3; }, {"cameras.bin", "two entries with the id 3"}},
        {"twice the name", [](ColmapScene& s) { s.images[2].name = s.images[1].name; },
         {"two images named 'walk/101.png'"}},
        {"no name", [](ColmapScene& s) { s.images[1].name = ""; }, {"image 49", "inside"}},
        {"focal length", [](ColmapScene& s) { s.cameras[0].parameters[0] = -30; },
         {"cameras.bin: camera 3", "focal length"}},
        {"NaN lens", [](ColmapScene& s) { s.cameras[0].parameters[3] = kNaN; }, {"camera 3", "not finite"}},
        {"folding lens", [](ColmapScene& s) { s.cameras[0].parameters[3] = -3; }, {"camera 3", "folds", "simpler lens"}},
        {"size", [](ColmapScene& s) { s.cameras[0].width = 1ull << 60; }, {"camera 3", "1152921504606846976x20"}},
    };
    for (const Case& c : cases) {
        CAPTURE(c.what);
        ColmapScene scene;
        scene.savePhotos();
        c.spoil(scene);
        scene.saveBinary();
        try {
            readColmap(scene.dir.path(), Split::train, false);
            FAIL("no error");
        } catch (const DataError& error) {
            CHECK_THAT(error.what(), Contains(scene.dir.path().string()));
            for (const std::string& part : c.message) CHECK_THAT(error.what(), Contains(part));
        }
    }
    for (const char* name : {"cameras.bin", "points3D.bin", "images.bin"}) {
        const ColmapScene scene;
        scene.savePhotos();
        scene.saveBinary();
        fs::remove(scene.dir / "sparse/0" / name);
        CHECK_THROWS_WITH(readColmap(scene.dir.path(), Split::train, false),
                          Contains("sparse/0: found neither " + std::string(name)));
    }
}

TEST_CASE("real models fit their points to less than a pixel", "[trainer][data]") {
    const auto path = dataPath("colmap");
    NERFVDB_NEEDS(path);
    const Dataset train = readColmap(path, Split::train, false);
    CHECK(train.views.size() > 3);
    CHECK(train.points.size() > 100);
    for (const char* place : {"sparse/0", "sparse", "colmap/sparse/0", "."}) {
        if (!isColmapModel(path / place)) continue;
        const auto error = reprojectionError(readColmapCameras(path / place), readColmapImages(path / place),
                                             readColmapPoints(path / place));
        REQUIRE(error);
        CHECK(*error < 1);
        return;
    }
    FAIL("no model in " << path);
}
