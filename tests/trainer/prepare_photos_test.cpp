// SPDX-License-Identifier: Apache-2.0
#include "trainer/prepare_photos.h"

#include <functional>

#include "core/error.h"
#include "core/image.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/fake_colmap.h"

using namespace nerfvdb;
using nerfvdb::testing::FakeColmap;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

struct Listener : Report {
    void info(const std::string& line) override { text += line + "\n"; }
    void warn(const std::string& line) override { text += "warning: " + line + "\n"; }
    bool cancelled() const override { return is_cancelled && is_cancelled(); }
    std::string text;
    std::function<bool()> is_cancelled;
};

/// Four photographs, a COLMAP that knows three of them, and an empty place for the data set.
struct Capture {
    explicit Capture(const std::vector<std::string>& names = {"a.png", "b.png", "c.png", "d.png"}) {
        fs::create_directory(images);
        for (const std::string& name : names) writeImage(images / name, Image(20, 10, 3));
        colmap.makeModel(0, {"a.png", "b.png", "c.png"});
    }
    PreparedPhotos prepare(const PrepareOptions& options = {}) {
        report.text.clear();
        return preparePhotos(images, out, options, report);
    }
    std::string log(const char* name) const { return readFile(out / "colmap" / name); }

    FakeColmap colmap;
    TempDir dir;
    fs::path images = dir / "my photos", out = dir / "data";
    Listener report;
};

/// The words that calls begin with.
std::vector<std::string> commandsOf(const std::vector<std::string>& calls) {
    std::vector<std::string> commands;
    for (const std::string& call : calls) commands.push_back(call.substr(0, call.find(' ')));
    return commands;
}

using Words = std::vector<std::string>;

}  // namespace

TEST_CASE("photographs become a data set by COLMAP's three phases", "[trainer]") {
    Capture capture;
    const PreparedPhotos result = capture.prepare();
    const Words calls = capture.colmap.takeCalls();
    REQUIRE(commandsOf(calls) == Words{"feature_extractor", "exhaustive_matcher", "mapper", "model_analyzer"});
    CHECK_THAT(calls[0], Contains("--database_path " + (capture.out / "colmap" / "database.db").string()) &&
                             Contains("--image_path " + (capture.out / "images").string()) &&
                             Contains("--ImageReader.camera_model OPENCV") &&
                             Contains("--ImageReader.single_camera 1") && Contains("--SiftExtraction.use_gpu 0") &&
                             Contains("--SiftExtraction.max_image_size 1600") &&
                             Contains("--SiftExtraction.max_num_features 4096") && Contains("[offscreen]"));
    CHECK_THAT(calls[1], Contains("--SiftMatching.use_gpu 0") && Contains("--ExhaustiveMatching.block_size"));
    CHECK_THAT(calls[2], Contains("--Mapper.num_threads"));

    CHECK(result.photos == 4);
    CHECK(result.unregistered == Words{"d.png"});
    CHECK(result.model_sizes == std::vector<std::size_t>{3});
    CHECK(result.points == 10);
    CHECK(result.reprojection_error == 0.625);
    CHECK(result.predicted_matching_seconds == Approx(matchingSeconds(6, 1000, threadCount())));
    CHECK((result.seconds.features && result.seconds.matching && result.seconds.mapping));
    CHECK(fs::exists(capture.out / "images" / "d.png"));
    for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"})
        CHECK(fs::exists(capture.out / "sparse" / "0" / file));
    CHECK(!fs::exists(capture.out / "colmap" / "models"));
    CHECK_THAT(capture.log("features.log"), Contains("Processed file [4/4]"));

    CHECK_THAT(capture.report.text,
               Contains("4 photographs, the first of 20x10; one camera for all (all of one size)") &&
                   Contains("matching: exhaustive, 6 pairs (few enough for all pairs)") &&
                   Contains("1000 features in a photograph: matching will take a few seconds") &&
                   Contains("warning: 1 of 4 photographs have no camera in it: d.png"));
}

TEST_CASE("options reach COLMAP, under the names that it knows", "[trainer]") {
    Capture capture;
    capture.colmap.tell("renamed");
    PrepareOptions options;
    options.matching = Matching::sequential;
    options.camera = CameraSharing::per_image;
    options.camera_model = "RADIAL";
    options.max_size = 1234;
    options.max_features = 567;
    capture.prepare(options);
    const Words calls = capture.colmap.takeCalls();
    REQUIRE(commandsOf(calls)[1] == "sequential_matcher");
    CHECK_THAT(calls[0], Contains("--ImageReader.camera_model RADIAL") &&
                             Contains("--ImageReader.single_camera_per_image 1") &&
                             Contains("--FeatureExtraction.use_gpu 0") &&
                             Contains("--FeatureExtraction.max_image_size 1234") &&
                             Contains("--SiftExtraction.max_num_features 567") &&
                             !Contains("SiftExtraction.use_gpu"));
    CHECK_THAT(calls[1], Contains("--FeatureMatching.use_gpu 0") && Contains("--SequentialMatching.overlap 10") &&
                             !Contains("block_size"));
}

TEST_CASE("the largest of several models comes first", "[trainer]") {
    Capture capture;
    capture.colmap.makeModel(0, {"a.png", "b.png"});
    capture.colmap.makeModel(1, {"b.png", "c.png", "d.png"});
    const PreparedPhotos result = capture.prepare();
    CHECK(result.model_sizes == std::vector<std::size_t>{3, 2});
    CHECK(result.points == 11);
    CHECK(result.unregistered == Words{"a.png"});
    CHECK_THAT(capture.report.text, Contains("fell apart into 2 models (of 3, 2 photographs)"));
    CHECK_THAT(readFile(capture.out / "sparse" / "0" / "images.bin"), Contains("d.png"));
    CHECK_THAT(readFile(capture.out / "sparse" / "1" / "images.bin"), !Contains("d.png") && Contains("a.png"));
}

TEST_CASE("a second call goes on with the phase that failed, a third finds all done", "[trainer]") {
    Capture capture;
    capture.colmap.tell("fail_mapper", "the last words\n\n=====\n");
    CHECK_THROWS_WITH(capture.prepare(), Contains((capture.out / "colmap" / "mapping.log").string() +
                                                  ": found that 'colmap mapper' ended with exit code 3") &&
                                             Contains("overlap"));
    CHECK_THAT(capture.report.text, Contains("colmap: something went wrong:\n  colmap: the last words\n") &&
                                        !Contains("===="));
    CHECK_THAT(capture.log("mapping.log"), Contains("the last words"));
    CHECK(!fs::exists(capture.out / "sparse"));
    capture.colmap.takeCalls();

    capture.colmap.forget("fail_mapper");
    const PreparedPhotos second = capture.prepare();
    CHECK(commandsOf(capture.colmap.takeCalls()) == Words{"mapper", "model_analyzer"});
    CHECK(!second.seconds.features);
    CHECK(second.seconds.mapping);

    const PreparedPhotos third = capture.prepare();
    CHECK(commandsOf(capture.colmap.takeCalls()) == Words{"model_analyzer"});
    CHECK(third.unregistered == Words{"d.png"});

    PrepareOptions anew;
    anew.force = true;
    capture.prepare(anew);
    CHECK(commandsOf(capture.colmap.takeCalls()) ==
          Words{"feature_extractor", "exhaustive_matcher", "mapper", "model_analyzer"});
}

TEST_CASE("stopping ends COLMAP and keeps what is done", "[trainer]") {
    Capture capture;
    capture.colmap.tell("hang_exhaustive_matcher");
    capture.report.is_cancelled = [&] { return capture.colmap.isHanging(); };
    try {
        capture.prepare();
        FAIL("it was not stopped");
    } catch (const Interrupted& stopped) {
        CHECK_THAT(stopped.what(), Contains("stopped while matching") && Contains("the same command goes on"));
    }
    CHECK(commandsOf(capture.colmap.takeCalls()) == Words{"feature_extractor", "exhaustive_matcher"});

    capture.colmap.forget("hang_exhaustive_matcher");
    capture.report.is_cancelled = nullptr;
    capture.prepare();
    CHECK(commandsOf(capture.colmap.takeCalls()) == Words{"exhaustive_matcher", "mapper", "model_analyzer"});
}

TEST_CASE("what a folder holds already is not overwritten", "[trainer]") {
    Capture capture;
    SECTION("poses of another program") {
        fs::create_directory(capture.out);
        writeAtomically(capture.out / "transforms.json", "{}");
        PrepareOptions force;
        force.force = true;
        CHECK_THROWS_WITH(capture.prepare(force), Contains("transforms.json: found a data set that has its poses"));
        CHECK(fs::exists(capture.out / "transforms.json"));
    }
    SECTION("a COLMAP model of another origin") {
        fs::create_directories(capture.out / "sparse" / "0");
        writeAtomically(capture.out / "sparse" / "0" / "images.bin", "precious");
        CHECK_THROWS_WITH(capture.prepare(), Contains("a COLMAP model of another origin") && Contains("--force"));
        CHECK(readFile(capture.out / "sparse" / "0" / "images.bin") == "precious");
    }
    SECTION("work on other photographs or with other options") {
        capture.prepare();
        PrepareOptions other;
        other.max_size = 800;
        CHECK_THROWS_WITH(capture.prepare(other), Contains("work begun with --max-size 1600, expected the same as now, 800"));
        other = {};
        other.matching = Matching::sequential;
        CHECK_THROWS_WITH(capture.prepare(other), Contains("a finished model by exhaustive matching"));
        writeImage(capture.images / "e.png", Image(20, 10, 3));
        CHECK_THROWS_WITH(capture.prepare(), Contains("work begun on other photographs"));
    }
}

TEST_CASE("photographs that lie in the data set already serve where they are", "[trainer]") {
    Capture capture;
    fs::create_directory(capture.out);
    fs::rename(capture.images, capture.out / "images");
    capture.images = capture.out / "images";
    CHECK(capture.prepare().photos == 4);
}

TEST_CASE("no COLMAP, or one that makes no model, is told with advice", "[trainer]") {
    Capture capture;
    SECTION("none on PATH") {
        const std::string path = std::getenv("PATH");
        setenv("PATH", capture.dir.path().c_str(), 1);
        CHECK_THROWS_WITH(capture.prepare(), Contains("colmap: found no such program on PATH") &&
                                                 Contains("sudo apt install colmap"));
        setenv("PATH", path.c_str(), 1);
        CHECK(!fs::exists(capture.out));
    }
    SECTION("no model") {
        capture.colmap.forget("registered.0");
        CHECK_THROWS_WITH(capture.prepare(), Contains("'colmap mapper' made no model"));
        CHECK(!fs::exists(capture.out / "sparse"));
    }
}
