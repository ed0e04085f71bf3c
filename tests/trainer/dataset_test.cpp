// SPDX-License-Identifier: Apache-2.0
#include "trainer/dataset.h"

#include <fstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/support/temp_dir.h"
#include "tests/trainer/colmap_scene.h"
#include "tests/trainer/scene_folder.h"
#include "trainer/dataset_hash.h"
#include "trainer/synthetic_scene.h"
#include "trainer/trainer.h"
#include "trainer/write_dataset.h"
#include "vdb/model_file.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

struct Notes : Report {
    void begin(const std::string&, std::int64_t total) override { total_units = total; }
    void update(std::int64_t n, const std::string&) override { done = n; }
    void warn(const std::string& line) override { warnings.push_back(line); }
    bool cancelled() const override { return done >= cancel_at; }
    std::int64_t total_units = 0, done = 0, cancel_at = 1 << 30;
    std::vector<std::string> warnings;
};

}  // namespace

TEST_CASE("photos are loaded in order, with progress", "[trainer]") {
    SceneFolder scene(40, 4);
    scene.save("transforms_train.json");
    Notes notes;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, {}, notes);
    REQUIRE(dataset.views.size() == 40);
    for (std::size_t i = 0; i < 40; ++i) CHECK(dataset.views[i].photo.pixels[0][0] == i);
    CHECK(dataset.has_alpha);
    CHECK(notes.total_units == 40);
    CHECK(notes.done == 40);
    CHECK(notes.warnings.empty());

    const Dataset cameras = readDataset(scene.dir.path(), Split::train, {false, false}, notes);
    CHECK(cameras.views.size() == 40);
    CHECK(cameras.views[0].photo.pixels.empty());
    CHECK(cameras.has_alpha);
}

TEST_CASE("alpha is what pixels say, not what headers have room for", "[trainer]") {
    SceneFolder scene(6, 4);
    Image opaque(20, 10, 4);
    for (std::size_t i = 3; i < opaque.pixels.size(); i += 4) opaque.pixels[i] = 1;
    for (int i = 0; i < 6; ++i) writeImage(scene.dir / ("images/" + std::to_string(100 + i) + ".png"), opaque);
    scene.save("transforms_train.json");
    Notes notes;
    CHECK_FALSE(readDataset(scene.dir.path(), Split::train, {}, notes).has_alpha);
    CHECK(notes.warnings.empty());

    opaque.at(7, 3)[3] = 0.5f;
    writeImage(scene.dir / "images/104.png", opaque);
    CHECK(readDataset(scene.dir.path(), Split::train, {}, notes).has_alpha);
    REQUIRE(notes.warnings.size() == 1);
    CHECK_THAT(notes.warnings[0], Contains("1 of 6 photographs are transparent somewhere, which") && Contains("--alpha-masks"));
}

TEST_CASE("a camera far from all others is told", "[trainer]") {
    SceneFolder scene(9);
    Notes notes;
    scene.save("transforms_train.json");
    readDataset(scene.dir.path(), Split::train, {false, false}, notes);
    CHECK(notes.warnings.empty());
    scene.frame(5)["transform_matrix"][0][3] = 1e5;
    scene.save("transforms_train.json");
    readDataset(scene.dir.path(), Split::train, {false, false}, notes);
    REQUIRE(notes.warnings.size() == 1);
    CHECK_THAT(notes.warnings[0], Contains("1 of 9 cameras") && Contains("105.png") && Contains("times as far"));
}

TEST_CASE("warnings reach the report and the data set", "[trainer]") {
    SceneFolder scene(9, 3);
    std::filesystem::remove(scene.dir / "images/104.png");
    scene.save();
    Notes notes;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, {}, notes);
    CHECK_FALSE(dataset.has_alpha);
    REQUIRE(notes.warnings.size() == 1);
    CHECK(notes.warnings == dataset.warnings);
    CHECK_THROWS_AS(readDataset(scene.dir.path(), Split::train, {.strict = true}, notes), DataError);
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, {.strict = true}, notes),
                      Contains("104.png") && Contains("leave out --strict"));
}

TEST_CASE("of several broken images the first is named, whatever the threads", "[trainer]") {
    SceneFolder scene(16);
    scene.save("transforms_train.json");
    for (const char* name : {"images/105.png", "images/111.png"})
        std::filesystem::resize_file(scene.dir / name, std::filesystem::file_size(scene.dir / name) - 10);
    const int threads = GENERATE(1, 0);
    const ThreadLimit limit(threads);
    Report report;
    CHECK_THROWS_AS(readDataset(scene.dir.path(), Split::train, {}, report), DataError);
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, {}, report),
                      Contains("105.png") && Contains("truncated"));
}

TEST_CASE("reading stops when the user asks", "[trainer]") {
    SceneFolder scene(40);
    scene.save("transforms_train.json");
    const ThreadLimit limit(1);
    Notes notes;
    notes.cancel_at = 1;
    CHECK_THROWS_AS(readDataset(scene.dir.path(), Split::train, {}, notes), Interrupted);
    CHECK(notes.done < 40);
}

TEST_CASE("cameras that all stand in one point are refused for training", "[trainer]") {
    SceneFolder scene(3);
    for (int i = 0; i < 3; ++i)
        for (int r = 0; r < 3; ++r) scene.frame(i)["transform_matrix"][r][3] = 1.5;
    scene.save("transforms_train.json");
    scene.save("transforms_test.json");
    Report report;
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, {}, report),
                      Contains("camera positions") && Contains("all 3 cameras in one point"));
    CHECK_NOTHROW(readDataset(scene.dir.path(), Split::test, {}, report));  // a turning head is fine to look at
}

TEST_CASE("a scene in map coordinates is a scene", "[trainer]") {
    Report report;
    for (const double far : {5e6, 1e7}) {
        SceneFolder scene(3);  // cameras on a ring of 4 m
        for (int i = 0; i < 3; ++i)
            for (int r = 0; r < 2; ++r)
                scene.frame(i)["transform_matrix"][r][3] = scene.frame(i)["transform_matrix"][r][3].get<double>() + far;
        scene.save("transforms_train.json");
        CHECK(readDataset(scene.dir.path(), Split::train, {}, report).views.size() == 3);
        // One point stays one, whatever rounding its way through a rotation brings.
        for (int i = 0; i < 3; ++i)
            for (int r = 0; r < 3; ++r) scene.frame(i)["transform_matrix"][r][3] = far + 1e-9 * i;
        scene.save("transforms_train.json");
        CHECK_THROWS_AS(readDataset(scene.dir.path(), Split::train, {}, report), DataError);
    }
}

TEST_CASE("the reader goes by what the folder holds", "[trainer]") {
    Report report;
    const auto focalLength = [&](const TempDir& dir) {
        return readDataset(dir.path(), Split::train, {.load_photos = false}, report).views[0].camera.fx;
    };
    ColmapScene colmap;
    CHECK_THROWS_AS(readDataset(colmap.dir / "absent", Split::train, {}, report), IoError);
    CHECK_THROWS_WITH(readDataset(colmap.dir.path(), Split::train, {}, report),
                      Contains("transforms.json") && Contains("sparse/0") && Contains("poses_bounds.npy"));
    colmap.savePhotos();
    writeAtomically(colmap.dir / "poses_bounds.npy", "not looked at");
    colmap.saveText();
    CHECK(focalLength(colmap.dir) == 31);
    SceneFolder scene(2);
    scene.save();
    CHECK(focalLength(scene.dir) == 15);
    std::filesystem::create_directory(scene.dir / "sparse");
    writeAtomically(scene.dir / "sparse/cameras.bin", "not looked at");
    CHECK(focalLength(scene.dir) == 15);
    std::filesystem::remove(scene.dir / "transforms.json");
    CHECK_THROWS_WITH(focalLength(scene.dir), Contains("images.bin"));
    std::filesystem::remove_all(scene.dir / "sparse");
    writeAtomically(scene.dir / "poses_bounds.npy", "looked at");
    CHECK_THROWS_WITH(focalLength(scene.dir), Contains("poses_bounds.npy: found no .npy"));
}

TEST_CASE("instant-ngp's box", "[trainer]") {
    // Its ngp coordinates are 0.33 world + 0.5, and the box is aabb_scale wide about 0.5.
    const Box box = sceneBoxFromAabbScale(4);
    CHECK(0.33 * box.max.x() + 0.5 == Approx(2.5));
    CHECK(0.33 * box.min.z() + 0.5 == Approx(-1.5));
}

TEST_CASE("lego as it was published", "[trainer][data]") {
    const auto path = dataPath("nerf_synthetic/lego");
    NERFVDB_NEEDS(path);
    Report report;
    const Dataset train = readDataset(path, Split::train, {}, report);
    CHECK(train.views.size() == 100);
    CHECK(train.has_alpha);
    CHECK(train.warnings.empty());
    CHECK_FALSE(train.aabb_scale);
    CHECK(train.views[10].path.filename() == "r_10.png");  // the JSON's order, not the alphabet's
    for (const View& view : train.views) {
        CHECK(view.photo.width == 800);
        CHECK(view.photo.height == 800);
        CHECK(view.camera.fx == Approx(1111.1110311937682).epsilon(1e-12));       // the value everyone quotes
        CHECK(view.camera.position.norm() == Approx(4.031128874).epsilon(1e-6));  // cameras on a sphere
        CHECK(cameraRay(view.camera, 400, 400).direction.dot(view.camera.position) < -4.03);  // looking inwards
    }
    // Straight alpha: transparent corner, opaque model; colours under half-transparent pixels are not darkened.
    const Photo& photo = train.views[0].photo;
    CHECK(photo.pixels[0][3] == 0);
    CHECK(photo.pixels[400 * 800 + 400][3] == 255);

    const Dataset test = readDataset(path, Split::test, {false, false}, report);
    CHECK(test.views.size() == 200);
    const Dataset val = readDataset(path, Split::val, {false, false}, report);
    CHECK(val.views.size() == 200);
    CHECK(val.warnings.size() == 1);
}

TEST_CASE("fox lists 67 frames and has 50", "[trainer][data]") {
    const auto path = dataPath("fox");
    NERFVDB_NEEDS(path);
    Notes notes;
    const Dataset test = readDataset(path, Split::test, {}, notes);
    CHECK(test.views.size() == 7);  // of 50: 0, 8, ..., 48
    REQUIRE(notes.warnings.size() == 1);
    CHECK_THAT(notes.warnings[0], Contains("17 of 67 frames"));
    CHECK(test.aabb_scale == 4.0);
    CHECK_FALSE(test.has_alpha);
    CHECK(test.views[0].photo.width == 1080);
    CHECK(test.views[0].photo.height == 1920);
    CHECK(test.views[0].camera.fx == 1375.52);
    CHECK(test.views[0].camera.distortion.k1 == 0.0578421);
    CHECK(readDataset(path, Split::train, {false, false}, notes).views.size() == 43);
    CHECK_THROWS_AS(readDataset(path, Split::train, {true, false}, notes), DataError);
}

TEST_CASE("egypt is read in the order of names", "[trainer][data]") {
    const auto path = dataPath("egypt");
    NERFVDB_NEEDS(path);
    Notes notes;
    const Dataset test = readDataset(path, Split::test, {}, notes);
    CHECK(notes.warnings.empty());
    CHECK(test.views.size() == 38);  // of 302
    CHECK(readDataset(path, Split::train, {false, false}, notes).views.size() == 264);
    CHECK(test.views[0].path.filename() == "frame_00001.jpg");  // the JSON starts at 302
    CHECK(test.views[1].path.filename() == "frame_00009.jpg");
    CHECK(test.views[0].photo.width == 480);
}

TEST_CASE("photographs that do not fit their share of memory are read from disk, and give the same model", "[trainer]") {
    const TempDir dir, cache_dir;
    SyntheticDatasetOptions scene;
    scene.train_views = 12, scene.val_views = 0, scene.test_views = 1;
    scene.width = 45, scene.height = 38;  // no whole number of tiles
    Report silent;
    writeSyntheticDataset(*makeSyntheticScene("sphere"), dir.path(), scene, silent);
    const std::size_t bytes = 12 * 45 * 38 * 4;
    const auto read = [&](std::size_t limit) {
        DatasetOptions options;
        options.max_photo_bytes = limit;
        options.cache_folder = cache_dir.path();
        return readDataset(dir.path(), Split::train, options, silent);
    };
    const Dataset in_memory = read(bytes), on_disk = read(bytes - 1);
    CHECK_FALSE(in_memory.views[3].photo.tiles);
    REQUIRE(on_disk.views[3].photo.tiles);
    CHECK(std::filesystem::is_empty(cache_dir.path()));
    CHECK(datasetHash(in_memory) == datasetHash(on_disk));

    const auto learned = [&](const Dataset& dataset) {
        TrainOptions options;
        options.steps = {36, 40, 10};
        const TrainResult result = train(dataset, options, silent, {});
        saveModel(result.model, dir / "model.vdb");
        CHECK(result.notes.size() == (dataset.views[0].photo.tiles ? 1 : 0));
        return readFile(dir / "model.vdb");
    };
    CHECK(learned(on_disk) == learned(in_memory));

    DatasetOptions nowhere;
    nowhere.max_photo_bytes = 1;
    nowhere.cache_folder = dir / "nowhere";
    CHECK_THROWS_AS(readDataset(dir.path(), Split::train, nowhere, silent), IoError);
}
