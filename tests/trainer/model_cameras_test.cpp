// SPDX-License-Identifier: Apache-2.0
#include "trainer/model_cameras.h"

#include "tests/support/catch.h"
#include "tests/trainer/scene_folder.h"
#include "vdb/camera_codec.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

struct Lines : Report {
    void info(const std::string& line) override { lines.push_back(line); }
    std::vector<std::string> lines;
};

}  // namespace

TEST_CASE("a model's cameras are the data set's, by names inside its folder") {
    SceneFolder scene(17);
    scene.save();
    Lines report;
    for (const std::filesystem::path& named :
         {scene.dir.path(), scene.dir / "transforms.json", scene.dir / "." / "images" / ".."}) {
        const Dataset dataset = readDataset(named, Split::train, {false, false}, report);
        const std::vector<ModelCamera> cameras = modelCameras(dataset, false);
        REQUIRE(cameras.size() == 14);
        for (std::size_t i = 0; i < cameras.size(); ++i) {
            CHECK(cameras[i].name == "images/" + dataset.views[i].path.filename().string());
            CHECK(cameras[i].camera.position == dataset.views[i].camera.position);
            CHECK_FALSE(cameras[i].held_out);
        }
        const std::vector<ModelCamera> held_out = heldOutCameras(named, report);
        REQUIRE(held_out.size() == 3);
        CHECK(held_out[1].name == "images/108.png");
        CHECK(held_out[1].held_out);
    }
    CHECK(report.lines.empty());
}

TEST_CASE("a data set without a test split has no held-out cameras, and says so") {
    SceneFolder scene(4);
    scene.save("transforms_train.json");
    Lines report;
    CHECK(heldOutCameras(scene.dir.path(), report).empty());
    REQUIRE(report.lines.size() == 1);
    CHECK_THAT(report.lines[0], Contains("no held-out views") && Contains("no test split"));
}

TEST_CASE("whatever a photograph is called, a model takes its camera") {
    Dataset dataset;
    for (const char* path : {"", "data/a.png", "/elsewhere/b.png", "data/x/../c.png", "data/../d.png", "data/e\n.png"})
        dataset.views.push_back({ringCamera(0, 2, 20, 10), path, {}});
    const auto names = [&](const char* root) {
        dataset.root = root;
        const std::vector<ModelCamera> cameras = modelCameras(dataset, false);
        CHECK(encodeCameras(cameras).size() > 0);  // throws on names that it does not take
        std::vector<std::string> result;
        for (const ModelCamera& camera : cameras) result.push_back(camera.name);
        return result;
    };
    const std::vector<std::string> inside = {"", "a.png", "b.png", "c.png", "d.png", "e?.png"};
    CHECK(names("data") == inside);
    CHECK(names("./data/") == inside);
    CHECK(names("data/transforms.json") == inside);
    CHECK(names("") == std::vector<std::string>{"", "data/a.png", "b.png", "data/c.png", "d.png", "data/e?.png"});
}
