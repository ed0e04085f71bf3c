// SPDX-License-Identifier: Apache-2.0
#include "trainer/downscale.h"

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/trainer/scene_folder.h"
#include "trainer/dataset.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

using Pixel = std::array<std::uint8_t, 4>;

Photo photoOf(int width, int height, std::vector<Pixel> pixels) {
    Photo photo;
    photo.width = width, photo.height = height;
    photo.pixels = std::move(pixels);
    return photo;
}

}  // namespace

TEST_CASE("a chequered block is as bright as its light, and a flat one keeps its value") {
    const Pixel black{0, 0, 0, 255}, white{255, 255, 255, 255};
    // Half of the light is 0.5 linear: 188 in sRGB, where the mean of the values would be 128.
    CHECK(downscaled(photoOf(2, 2, {black, white, white, black}), 2).pixels[0] == Pixel{188, 188, 188, 255});
    for (int value = 0; value < 256; ++value) {
        const auto v = static_cast<std::uint8_t>(value);
        const Photo flat = photoOf(4, 4, std::vector<Pixel>(16, {v, v, static_cast<std::uint8_t>(255 - v), 255}));
        REQUIRE(downscaled(flat, 4).pixels == std::vector<Pixel>{flat.pixels[0]});
    }
}

TEST_CASE("what is transparent gives no colour to its block") {
    const Pixel red{200, 0, 0, 255}, unseen{0, 255, 255, 0}, faint{0, 255, 0, 51};
    CHECK(downscaled(photoOf(2, 2, {red, unseen, unseen, red}), 2).pixels[0] == Pixel{200, 0, 0, 128});
    CHECK(downscaled(photoOf(2, 2, {unseen, unseen, unseen, unseen}), 2).pixels[0] == Pixel{0, 0, 0, 0});
    // Light of 255 x red and 51 x green, of 306 in all.
    const Pixel mixed = downscaled(photoOf(2, 2, {red, faint, unseen, unseen}), 2).pixels[0];
    const auto share = [](float linear) { return std::lround(255 * srgbFromLinear(linear)); };
    CHECK(mixed[0] == share(linearFromSrgb(200 / 255.0f) * 255 / 306));
    CHECK(mixed[1] == share(51.0f / 306));
    CHECK(mixed[2] == 0);
    CHECK(mixed[3] == 77);  // (255 + 51) / 4, rounded
}

TEST_CASE("pixels that fill no block are left out, and rays go where they went") {
    Camera camera = lookAt(Vec3d(1, 2, 3), Vec3d::Zero(), Vec3d::UnitZ(), 0.7, 19, 11);
    camera.cx += 0.3;
    camera.distortion.k1 = 0.05;
    const Camera small = downscaled(camera, 4);
    CHECK(small.width == 4);
    CHECK(small.height == 2);
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 4; ++x) {
            const Vec3d ray = cameraRay(small, x + 0.5, y + 0.5).direction;
            CHECK((ray - cameraRay(camera, 4 * x + 2, 4 * y + 2).direction).norm() < 1e-12);
        }
    std::vector<Pixel> pixels;
    for (int i = 0; i < 5 * 3; ++i) pixels.push_back({static_cast<std::uint8_t>(i), 0, 0, 255});
    const Photo photo = downscaled(photoOf(5, 3, pixels), 2);
    CHECK(photo.width == 2);
    CHECK(photo.height == 1);
    CHECK((photo.pixels[0][0] >= 2 && photo.pixels[0][0] <= 4));  // of 0, 1, 5, 6
    CHECK((photo.pixels[1][0] >= 4 && photo.pixels[1][0] <= 6));  // of 2, 3, 7, 8
}

TEST_CASE("a block counts if all of its pixels do") {
    PixelMask mask(4, 2);
    for (int i = 0; i < 8; ++i)
        if (i != 6) mask.keep(i % 4, i / 4);
    const PixelMask small = downscaled(mask, 2);
    CHECK(small.counts(0, 0));
    CHECK_FALSE(small.counts(1, 0));
    CHECK(downscaled(PixelMask(), 2).empty());
}

TEST_CASE("a data set is read downscaled: cameras, photographs and masks fit each other") {
    SceneFolder scene(3);
    std::filesystem::create_directory(scene.dir / "masks");
    Image mask(20, 10, 1);
    std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
    mask.at(0, 0)[0] = 0;
    for (const char* name : {"100.png", "101.png", "102.png"}) writeImage(scene.dir / "masks" / name, mask);
    scene.save("transforms_train.json");
    Report silent;
    DatasetOptions options;
    options.downscale = 4;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, options, silent);
    for (const View& view : dataset.views) {
        CHECK(view.camera.width == 5);
        CHECK(view.camera.height == 2);
        CHECK(view.photo.width == 5);
        CHECK(view.photo.height == 2);
        CHECK(view.camera.fx == 15.0 / 4);
        CHECK(view.camera.cy == 5.0 / 4);
        CHECK(view.mask.width() == 5);
        CHECK(view.mask.count() == 9);
    }
    options.load_photos = false;
    CHECK(readDataset(scene.dir.path(), Split::train, options, silent).views[0].camera.width == 5);
    options.downscale = 16;
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, options, silent),
                      Contains("--downscale: found 16") && Contains("20x10"));
}

TEST_CASE("a mask of which no block is left is named") {
    SceneFolder scene(2);
    std::filesystem::create_directory(scene.dir / "masks");
    Image mask(20, 10, 1);
    mask.at(5, 5)[0] = 1;
    writeImage(scene.dir / "masks/101.png", mask);
    scene.save("transforms_train.json");
    Report silent;
    CHECK_NOTHROW(readDataset(scene.dir.path(), Split::train, {}, silent));
    DatasetOptions options;
    options.downscale = 2;
    CHECK_THROWS_AS(readDataset(scene.dir.path(), Split::train, options, silent), DataError);
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, options, silent),
                      Contains("101.png") && Contains("every block of 2x2") && Contains("--no-masks"));
}
