// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_model.h"

#include <functional>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/trainer/colmap_scene.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

/// What a reader says of these bytes in a file of this name; "" if it takes them.
std::string refusal(const std::string& name, const std::string& bytes) {
    const TempDir dir;
    writeAtomically(dir / name, bytes);
    try {
        if (name.starts_with("cameras")) readColmapCameras(dir.path());
        if (name.starts_with("images")) readColmapImages(dir.path());
        if (name.starts_with("points3D")) readColmapPoints(dir.path());
        return "";
    } catch (const DataError& error) {
        CHECK_THAT(error.what(), Contains((dir / name).string()) && Contains("found") && Contains("expected"));
        return error.what();
    }
}

/// Two images of few points, so that every byte can be tried.
struct SmallScene : ColmapScene {
    SmallScene() {
        images.resize(2);
        for (ColmapImage& image : images) image.observations.resize(2);
        points.resize(3);
    }
};

}  // namespace

TEST_CASE("binary and text say the same, sorted by id", "[trainer]") {
    const ColmapScene scene;
    scene.saveBinary("binary");
    scene.saveText("text");
    CHECK(isColmapModel(scene.dir / "binary"));
    CHECK(isColmapModel(scene.dir / "text"));
    CHECK_FALSE(isColmapModel(scene.dir.path()));
    for (const char* folder : {"binary", "text"}) {
        CAPTURE(folder);
        const auto cameras = readColmapCameras(scene.dir / folder);
        REQUIRE(cameras.entries.size() == 3);
        for (std::size_t i = 0; i < 3; ++i) {
            CHECK(cameras.entries[i].id == scene.cameras[i].id);
            CHECK(cameras.entries[i].model == scene.cameras[i].model);
            CHECK(cameras.entries[i].width == 40);
            CHECK(cameras.entries[i].height == 20);
            CHECK(cameras.entries[i].parameters == scene.cameras[i].parameters);
        }
        const auto images = readColmapImages(scene.dir / folder);
        REQUIRE(images.entries.size() == 18);
        for (std::size_t i = 0; i < 18; ++i) {
            const ColmapImage &image = images.entries[i], &expected = scene.images[17 - i];
            CHECK(image.id == expected.id);
            CHECK(image.rotation == expected.rotation);
            CHECK(image.translation == expected.translation);
            CHECK(image.camera == expected.camera);
            CHECK(image.name == expected.name);
            REQUIRE(image.observations.size() == expected.observations.size());
            for (std::size_t k = 0; k < image.observations.size(); ++k) {
                CHECK(image.observations[k].pixel == expected.observations[k].pixel);
                CHECK(image.observations[k].point == expected.observations[k].point);
            }
        }
        const auto points = readColmapPoints(scene.dir / folder);
        REQUIRE(points.entries.size() == 40);
        for (std::size_t i = 0; i < 40; ++i) {
            CHECK(points.entries[i].id == scene.points[i].id);
            CHECK(points.entries[i].position == scene.points[i].position);
            CHECK(points.entries[i].track_length == scene.points[i].track_length);
        }
    }
}

TEST_CASE("a binary file cut short at any byte is refused, and so is one that goes on", "[trainer]") {
    const SmallScene scene;
    const std::pair<const char*, std::string> files[] = {{"cameras.bin", scene.camerasBinary()},
                                                         {"images.bin", scene.imagesBinary()},
                                                         {"points3D.bin", scene.pointsBinary()}};
    for (const auto& [name, bytes] : files) {
        CAPTURE(name);
        CHECK(refusal(name, bytes).empty());
        for (std::size_t size = 0; size < bytes.size(); ++size) {
            CAPTURE(size);
            CHECK_THAT(refusal(name, bytes.substr(0, size)), Contains("copy it again"));
        }
        CHECK_THAT(refusal(name, bytes + "x"), Contains("1 bytes after the last entry"));
    }
}

TEST_CASE("counts that no file could hold allocate nothing", "[trainer]") {
    const SmallScene scene;
    for (const std::uint64_t count : {std::uint64_t{4}, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
        const std::string word = ColmapScene::word(count, 8);
        CHECK_THAT(refusal("cameras.bin", scene.camerasBinary().replace(0, 8, word)), Contains("copy it again"));
        CHECK_THAT(refusal("images.bin", scene.imagesBinary().replace(0, 8, word)), Contains("copy it again"));
        CHECK_THAT(refusal("points3D.bin", scene.pointsBinary().replace(0, 8, word)), Contains("copy it again"));
    }
    const std::size_t features = 8 + 4 + 56 + 4 + scene.images[0].name.size() + 1;
    const std::string many = ColmapScene::word(~std::uint64_t{0}, 8);
    CHECK_THAT(refusal("images.bin", scene.imagesBinary().replace(features, 8, many)),
               Contains("after a count of features of 18446744073709551615"));
    CHECK_THAT(refusal("points3D.bin", scene.pointsBinary().replace(8 + 8 + 24 + 3 + 8, 8, many)),
               Contains("after a track's length of 18446744073709551615"));
}

TEST_CASE("damaged bytes are read or refused, nothing else", "[trainer]") {
    const SmallScene scene;
    int refused = 0;
    for (std::uint64_t i = 0; i < 3000; ++i) {
        const bool is_text = i % 2 == 1;
        const std::pair<const char*, std::string> files[] = {
            {is_text ? "cameras.txt" : "cameras.bin", is_text ? scene.camerasText() : scene.camerasBinary()},
            {is_text ? "images.txt" : "images.bin", is_text ? scene.imagesText() : scene.imagesBinary()},
            {is_text ? "points3D.txt" : "points3D.bin", is_text ? scene.pointsText() : scene.pointsBinary()}};
        auto [name, bytes] = files[i / 2 % 3];
        bytes[randomBits(1, i, 0) % bytes.size()] = static_cast<char>(randomBits(1, i, 1));
        refused += !refusal(name, bytes).empty();
    }
    CHECK(refused > 500);
}

TEST_CASE("text with garbage is refused with its line", "[trainer]") {
    CHECK_THAT(refusal("cameras.txt", "# a comment\n\n1 PINHOLE 40 20 30 30 20\n"),
               Contains("line 3: found the end of the line, expected a lens parameter"));
    CHECK_THAT(refusal("cameras.txt", "1 PINHOLE 40 20 30 30 20 10 5\n"), Contains("line 1: found more than 4 parameters"));
    CHECK_THAT(refusal("cameras.txt", "1 PINHOLE 40x 20 30 30 20 10\n"), Contains("found '40x', expected a width"));
    CHECK_THAT(refusal("cameras.txt", "1 PINHOLE -40 20 30 30 20 10\n"), Contains("found '-40', expected a width"));
    CHECK_THAT(refusal("cameras.txt", "1 PINHOLE 40 99999999999999999999 1 1 1 1\n"), Contains("a height"));
    CHECK_THAT(refusal("cameras.txt", "1 PINHOLE 40 20 1e999 30 20 10\n"), Contains("found '1e999'"));
    CHECK_THAT(refusal("cameras.txt", "\x01\x02\xff\n"), Contains("line 1: found '") && Contains("a camera's id"));
    CHECK_THAT(refusal("cameras.txt", "1 THIN_PRISM_FISHEYE 40 20 1\n"),
               Contains("the lens model THIN_PRISM_FISHEYE") && Contains("OPENCV_FISHEYE") && Contains("image_undistorter"));
    CHECK_THAT(refusal("cameras.bin", ColmapScene::word(1, 8) + ColmapScene::word(1, 4) + ColmapScene::word(7, 4) +
                                          std::string(56, '\0')),
               Contains("camera 1: found the lens model FOV"));
    CHECK_THAT(refusal("images.txt", "1 1 0 0 0 0 0 0 1\n\n"), Contains("line 1: found the end of the line, expected a name"));
    CHECK_THAT(refusal("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n1 2\n"), Contains("line 2") && Contains("a feature's point"));
    CHECK_THAT(refusal("points3D.txt", "1 0 0 0 1 2 3 0.5 1\n"), Contains("a track's feature"));
    CHECK_THAT(refusal("points3D.txt", "1 0 0 zero 1 2 3 0.5\n"), Contains("found 'zero', expected a position"));
    CHECK_THAT(refusal("points3D.txt", "1 0 0 0 1 2 3 0.5\n1 0 0 0 1 2 3 0.5\n"), Contains("two entries with the id 1"));
}

TEST_CASE("text that ends before what its head counts was cut short", "[trainer]") {
    const std::string head = "# Number of images: 2, mean observations per image: 0\n";
    const std::string image = " 1 0 0 0 0 0 0 1 a.png\n\n";
    CHECK_THAT(refusal("images.txt", head + "1" + image),
               Contains("images.txt: found 1 entries, expected 2") && Contains("cut short"));
    CHECK_THAT(refusal("cameras.txt", "# Number of cameras: 3\n1 PINHOLE 40 20 30 30 20 10\n"), Contains("expected 3"));
    CHECK_THAT(refusal("points3D.txt", "# Number of points: 1, mean track length: 2\n"), Contains("found 0 entries"));
    const TempDir dir;
    writeAtomically(dir / "images.txt", head + "1" + image + "2" + image + "3" + image);  // more were added by hand
    CHECK(readColmapImages(dir.path()).entries.size() == 3);
}

TEST_CASE("text is read as people leave it: blanks, comments, no features, names with blanks", "[trainer]") {
    const TempDir dir;
    writeAtomically(dir / "images.txt",
                    "# list\r\n  2 1 0 0 0\t0 0 0 1 my walk/a b.png \r\n\r\n\n1 1 0 0 0 nan 0 inf 1 c.png");
    const auto images = readColmapImages(dir.path());
    REQUIRE(images.entries.size() == 2);
    CHECK(images.entries[1].name == "my walk/a b.png");
    CHECK(images.entries[1].observations.empty());
    CHECK(images.entries[0].name == "c.png");
    CHECK(std::isnan(images.entries[0].translation.x()));
}

TEST_CASE("an absent part is named", "[trainer]") {
    const TempDir dir;
    CHECK_THROWS_WITH(readColmapPoints(dir.path()), Contains("neither points3D.bin nor points3D.txt"));
}
