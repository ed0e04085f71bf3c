// SPDX-License-Identifier: Apache-2.0
#include "trainer/mask.h"

#include <algorithm>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/temp_dir.h"
#include "tests/trainer/scene_folder.h"
#include "trainer/dataset.h"
#include "trainer/dataset_hash.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

struct Notes : Report {
    void info(const std::string& line) override { infos.push_back(line); }
    void warn(const std::string& line) override { warnings.push_back(line); }
    std::vector<std::string> infos, warnings;
};

/// A grey picture with one rectangle of another grey.
void writeGrey(const std::filesystem::path& path, int width, int height, int grey, Vec3i corner = {0, 0, 0},
               int patch = 0) {
    Image image(width, height, 1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.at(x, y)[0] = static_cast<float>(x < corner.x() && y < corner.y() ? patch : grey) / 255.0f;
    std::filesystem::create_directories(path.parent_path());
    writeImage(path, image);
}

}  // namespace

TEST_CASE("masks are found by the habits of nerfstudio and COLMAP") {
    const TempDir dir;
    const auto touch = [&](const std::string& name) {
        std::filesystem::create_directories((dir / name).parent_path());
        writeAtomically(dir / name, "x");
        return dir / name;
    };
    const auto found = [&](const std::string& image) { return findMask(dir / image, dir.path()); };
    CHECK(found("images/a.jpg").empty());
    // The least particular name first: each of the next goes over those before.
    for (const char* name : {"images/masks/a.png", "masks/a.jpg", "masks/a.jpg.png", "masks/a.png", "masks/images/a.png"}) {
        CAPTURE(name);
        const auto mask = touch(name);
        CHECK(found("images/a.jpg") == mask);
    }
    CHECK(found("images/b.jpg").empty());
    // Folders below, and photographs without a folder of their own.
    CHECK(found("images/cat/c.png").empty());
    const auto deep = touch("masks/cat/c.png");
    CHECK(found("images/cat/c.png") == deep);
    const auto flat = touch("masks/d.png");
    CHECK(found("d.jpg") == flat);
    CHECK(findMask(dir / "images" / ".." / "images" / "d.jpg", dir.path()) == flat);
    // r_0 of train is not r_0 of test.
    touch("masks/r_0.png");
    CHECK(found("train/r_0.png").empty());
    const auto train = touch("masks/train/r_0.png");
    CHECK(found("train/r_0.png") == train);
    CHECK(found("test/r_0.png").empty());
    // Photographs outside the data set's folder.
    CHECK(findMask(dir / "images/b/../d.jpg", dir / "models") == flat);
}

TEST_CASE("black pixels of a mask do not count, and sizes of the same aspect are scaled") {
    const TempDir dir;
    bool was_scaled = true;
    writeGrey(dir / "m.png", 20, 10, 255, {6, 4, 0}, 0);
    const PixelMask mask = readMask(dir / "m.png", 20, 10, was_scaled);
    CHECK_FALSE(was_scaled);
    CHECK(mask.count() == 200 - 24);
    CHECK_FALSE(mask.counts(5, 3));
    CHECK(mask.counts(6, 3));
    CHECK(mask.counts(5, 4));

    const PixelMask larger = readMask(dir / "m.png", 60, 31, was_scaled);  // 10 of 20 is 30 or 31 of 60
    CHECK(was_scaled);
    CHECK_FALSE(larger.counts(17, 11));
    CHECK(larger.counts(18, 11));
    const PixelMask smaller = readMask(dir / "m.png", 10, 5, was_scaled);
    CHECK(was_scaled);
    CHECK(smaller.count() == 50 - 6);

    writeGrey(dir / "soft.png", 20, 10, 128, {6, 4, 0}, 127);
    CHECK(readMask(dir / "soft.png", 20, 10, was_scaled) == mask);

    for (const auto& [width, height] : {std::pair{10, 20}, {20, 13}, {200, 90}}) {
        CAPTURE(width, height);
        CHECK_THROWS_AS(readMask(dir / "m.png", width, height, was_scaled), DataError);
        CHECK_THROWS_WITH(readMask(dir / "m.png", width, height, was_scaled),
                          Contains("m.png") && Contains("20x10") && Contains("--no-masks"));
    }
    writeGrey(dir / "black.png", 20, 10, 1);
    CHECK_THROWS_AS(readMask(dir / "black.png", 20, 10, was_scaled), DataError);
    CHECK_THROWS_WITH(readMask(dir / "black.png", 20, 10, was_scaled),
                      Contains("black.png") && Contains("hides the whole photograph") && Contains("--no-masks"));
}

TEST_CASE("a data set reads the masks beside its images, and says what they leave out") {
    SceneFolder scene(4);
    scene.save("transforms_train.json");
    Notes plain;
    CHECK(readDataset(scene.dir.path(), Split::train, {}, plain).views[0].mask.empty());
    CHECK(plain.infos.empty());
    writeGrey(scene.dir / "masks/100.png", 20, 10, 255, {20, 5, 0});
    writeGrey(scene.dir / "masks/102.png.png", 10, 5, 255, {5, 5, 0});
    Notes notes;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, {}, notes);
    CHECK(dataset.views[0].mask.count() == 100);
    CHECK(dataset.views[1].mask.empty());
    CHECK(dataset.views[2].mask.count() == 100);
    CHECK(maskedShare(dataset) == 0.25);
    REQUIRE(notes.infos.size() == 1);
    CHECK_THAT(notes.infos[0], Contains("masks leave out 25.0 %"));
    REQUIRE(notes.warnings.size() == 2);
    CHECK_THAT(notes.warnings[0], Contains("2 of 4 photographs have no mask"));
    CHECK_THAT(notes.warnings[1], Contains("1 of 4 photographs") && Contains("another size") && Contains("102.png.png"));
    CHECK(dataset.warnings == notes.warnings);

    Notes without;
    DatasetOptions options;
    options.use_masks = false;
    const Dataset all = readDataset(scene.dir.path(), Split::train, options, without);
    CHECK(all.views[0].mask.empty());
    CHECK(without.infos.empty());
    CHECK(datasetHash(all) != datasetHash(dataset));
    scene.frame(1)["mask_path"] = "masks/100.png";  // named masks, too
    scene.save("transforms_train.json");
    CHECK(readDataset(scene.dir.path(), Split::train, options, without).views[1].mask.empty());
    scene.frame(1).erase("mask_path");
    scene.save("transforms_train.json");

    for (const char* name : {"masks/101.png", "masks/103.png"}) writeGrey(scene.dir / name, 20, 10, 0);
    CHECK_THROWS_WITH(readDataset(scene.dir.path(), Split::train, {}, notes), Contains("101.png"));
}

TEST_CASE("masks that have no photograph's name are told", "[trainer]") {
    SceneFolder scene(4);
    scene.save("transforms_train.json");
    writeGrey(scene.dir / "masks/0001.png", 20, 10, 255);
    Notes notes;
    readDataset(scene.dir.path(), Split::train, {}, notes);
    REQUIRE(notes.warnings.size() == 1);
    CHECK_THAT(notes.warnings[0], Contains("masks: no mask has the name of a photograph"));
}

TEST_CASE("alpha can be a mask: what is more than half transparent does not count", "[trainer]") {
    Photo photo;
    photo.width = 3;
    photo.height = 1;
    photo.has_alpha = true;
    photo.pixels = {{10, 20, 30, 255}, {10, 20, 30, 128}, {10, 20, 30, 127}};
    PixelMask mask(3, 1);
    mask.keep(1, 0);
    mask.keep(2, 0);
    Photo both = photo;
    maskByAlpha(both, mask, "a.png");
    CHECK(mask.count() == 1);
    CHECK(mask.counts(1, 0));
    CHECK_FALSE(both.has_alpha);
    CHECK(both.pixels[2] == Photo::Pixel{10, 20, 30, 255});
    PixelMask none;
    maskByAlpha(both, none, "a.png");  // opaque now
    CHECK(none.empty());
    for (Photo::Pixel& pixel : photo.pixels) pixel[3] = 3;
    CHECK_THROWS_WITH(maskByAlpha(photo, none, "a.png"), Contains("a.png") && Contains("without --alpha-masks"));

    SceneFolder scene(2, 4);  // alpha 0 everywhere, ...
    for (int i = 0; i < 2; ++i) {
        Image image(20, 10, 4);
        for (int x = 0; x < 5; ++x) image.at(x, 4)[3] = 1;  // ... but for five pixels
        writeImage(scene.dir / ("images/" + std::to_string(100 + i) + ".png"), image);
    }
    scene.save("transforms_train.json");
    Notes notes;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, {.alpha_masks = true}, notes);
    CHECK_FALSE(dataset.has_alpha);
    CHECK(dataset.views[1].mask.count() == 5);
    CHECK(maskedShare(dataset) == 0.975);
    CHECK(notes.warnings.empty());
}

TEST_CASE("alpha that is not to be known leaves photographs on white", "[trainer]") {
    SceneFolder scene(1, 4);
    Image image(20, 10, 4);
    image.at(3, 4)[0] = 0.4f, image.at(3, 4)[3] = 1;
    image.at(4, 4)[0] = 0.4f, image.at(4, 4)[3] = 0.6f;
    writeImage(scene.dir / "images/100.png", image);
    scene.save("transforms_train.json");
    Notes notes;
    const Dataset dataset = readDataset(scene.dir.path(), Split::train, {.no_alpha = true}, notes);
    CHECK_FALSE(dataset.has_alpha);
    const Photo& photo = dataset.views[0].photo;
    CHECK_FALSE(photo.has_alpha);
    CHECK(photo.at(0, 0) == Photo::Pixel{255, 255, 255, 255});
    CHECK(photo.at(3, 4) == Photo::Pixel{102, 0, 0, 255});
    CHECK(photo.at(4, 4) == Photo::Pixel{163, 102, 102, 255});  // 0.6 of it and 0.4 of white
    CHECK(dataset.views[0].mask.empty());
}

TEST_CASE("what a mask hides changes nothing of what is learned") {
    // The same photographs, with other colours where the masks hide them.
    Dataset first = test::sphereDataset(Split::train, 12, 48), second = first;
    for (std::size_t v = 0; v < 12; ++v) {
        PixelMask mask(48, 48);
        for (int y = 0; y < 48; ++y)
            for (int x = 0; x < 48; ++x)
                if ((x + y + static_cast<int>(v)) % 17 > 4) mask.keep(x, y);
                else second.views[v].photo.pixels[static_cast<std::size_t>(48 * y + x)][1] ^= 0xff;
        first.views[v].mask = second.views[v].mask = mask;
    }
    const auto learned = [](const Dataset& dataset) {
        TrainOptions options;
        options.steps = {36, 40, 10};
        Report silent;
        const TempDir dir;
        saveModel(train(dataset, options, silent, {}).model, dir / "model.vdb");
        return readFile(dir / "model.vdb");
    };
    const std::string model = learned(first);
    CHECK(learned(second) == model);
    Dataset seen = second;
    for (View& view : seen.views) view.mask = {};
    CHECK(learned(seen) != model);
    const ThreadLimit one(1);
    CHECK(learned(first) == model);
}
