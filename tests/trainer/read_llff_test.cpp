// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_llff.h"

#include <cmath>
#include <functional>

#include "core/error.h"
#include "core/image.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/trainer/npy_bytes.h"
#include "tests/trainer/scene_folder.h"

using namespace nerfvdb;
using namespace nerfvdb::testing;
using Catch::Contains;

namespace {

/// Ten images of 20x10 pixels that were 80x40 when they were posed; their cameras are ringCamera(i, 10, 80, 40).
struct LlffFolder {
    TempDir dir;
    std::vector<std::vector<double>> rows;

    LlffFolder() {
        std::filesystem::create_directory(dir / "images");
        for (int i = 0; i < 10; ++i) {
            writeImage(dir / "images" / ("view" + std::to_string(i) + ".png"), Image(20, 10, 3));
            const Camera camera = ringCamera(i, 10, 80, 40);
            const Mat3d& m = camera.world_from_camera;
            std::vector<double> row;
            const double last[] = {40, 80, camera.fx};
            for (int r = 0; r < 3; ++r)
                row.insert(row.end(), {-m(r, 1), m(r, 0), m(r, 2), camera.position[r], last[r]});
            row.insert(row.end(), {2.0 + i, 6.0});
            rows.push_back(row);
        }
        rows[9][15] = 7;  // farther than far
    }
    void save() const {
        std::vector<double> values;
        for (const auto& row : rows) values.insert(values.end(), row.begin(), row.end());
        writeAtomically(dir / "poses_bounds.npy", npyBytes(values, rows.size(), rows.empty() ? 17 : rows[0].size()));
    }
};

}  // namespace

TEST_CASE("LLFF's columns become our axes, its focal length that of the images that are there", "[trainer]") {
    LlffFolder folder;
    CHECK_FALSE(hasLlff(folder.dir.path()));
    folder.save();
    CHECK(hasLlff(folder.dir.path()));
    const Dataset test = readLlff(folder.dir.path(), Split::test);
    const Dataset train = readLlff(folder.dir.path(), Split::train);
    REQUIRE(test.views.size() == 2);
    REQUIRE(train.views.size() == 8);
    CHECK(test.views[1].path.filename() == "view8.png");
    CHECK(train.views[0].path.filename() == "view1.png");
    for (int i = 1; i < 8; ++i) {
        const Camera expected = resized(ringCamera(i, 10, 80, 40), 20, 10);
        const Camera& camera = train.views[static_cast<std::size_t>(i - 1)].camera;
        CHECK((camera.world_from_camera - expected.world_from_camera).norm() < 1e-14);
        CHECK(camera.position == expected.position);
        CHECK(camera.fx == Approx(expected.fx).epsilon(1e-14));
        CHECK(camera.cx == 10);
        CHECK(camera.cy == 5);
        CHECK(camera.width == 20);
    }
    REQUIRE(train.views[0].depth_range);
    CHECK(train.views[0].depth_range->near == 3);
    CHECK(train.views[0].depth_range->far == 6);
    CHECK_FALSE(train.views[7].depth_range);
    REQUIRE(train.warnings.size() == 1);
    CHECK_THAT(train.warnings[0], Contains("rows have no depths"));
}

TEST_CASE("LLFF files that make no cameras are named by row", "[trainer]") {
    struct Case {
        std::string what;
        std::function<void(LlffFolder&)> spoil;
        std::string message;
    };
    const Case cases[] = {
        {"NaN", [](LlffFolder& f) { f.rows[1][0] = NAN; }, "poses_bounds.npy: row 1: found pose is not finite"},
        {"mirrored", [](LlffFolder& f) { for (int r = 0; r < 3; ++r) f.rows[1][5 * r] *= -1; }, "row 1: found pose is a mirror"},
        {"zeros", [](LlffFolder& f) { f.rows[1].assign(17, 0); }, "row 1: found images of 0"},
        {"focal length", [](LlffFolder& f) { f.rows[1][14] = 0; }, "row 1: found focal length"},
        {"NaN size", [](LlffFolder& f) { f.rows[1][4] = NAN; }, "row 1: found images of 80"},
        {"absurd size", [](LlffFolder& f) { f.rows[1][4] = 1e300; }, "expected whole pixels"},
        {"other aspect", [](LlffFolder& f) { f.rows[1][4] = 80; }, "view1.png of 20x10 pixels, expected 80x80"},
        {"columns", [](LlffFolder& f) { for (auto& row : f.rows) row.pop_back(); }, "rows of 16 numbers, expected 17"},
        {"a row short", [](LlffFolder& f) { f.rows.pop_back(); }, "9 poses for 10 images"},
        {"nothing", [](LlffFolder& f) { f.rows.clear(); }, "0 poses for 10 images"},
        {"an image more", [](LlffFolder& f) { writeImage(f.dir / "images/z.png", Image(2, 1, 3)); }, "10 poses for 11 images"},
        {"no images", [](LlffFolder& f) { std::filesystem::remove_all(f.dir / "images"); }, "no folder 'images'"},
    };
    for (const Case& c : cases) {
        CAPTURE(c.what);
        LlffFolder folder;
        c.spoil(folder);
        folder.save();
        CHECK_THROWS_AS(readLlff(folder.dir.path(), Split::train), DataError);
        CHECK_THROWS_WITH(readLlff(folder.dir.path(), Split::train), Contains(c.message));
    }
}

TEST_CASE("horns as they were published", "[trainer][data]") {
    const auto path = dataPath("llff_horns");
    NERFVDB_NEEDS(path);
    const Dataset test = readLlff(path, Split::test), train = readLlff(path, Split::train);
    CHECK(test.views.size() == 8);
    CHECK(train.views.size() == 54);
    CHECK(train.warnings.empty());
    for (const View& view : train.views) {
        CHECK(view.camera.width == 504);
        CHECK(view.camera.height == 378);
        REQUIRE(view.depth_range);
        // Forward-facing: all look the same way, within 45 degrees, from a patch that is small beside what they see.
        CHECK(view.camera.world_from_camera.col(2).dot(test.views[0].camera.world_from_camera.col(2)) > 0.7);
    }
    // Where one camera's axis is at a middle depth, its neighbour sees it: only right if axes and signs are.
    for (std::size_t i = 0; i + 1 < train.views.size(); ++i) {
        const View& view = train.views[i];
        const double depth = 2 / (1 / view.depth_range->near + 1 / view.depth_range->far);
        const auto pixel = projectPoint(train.views[i + 1].camera,
                                        view.camera.position - depth * view.camera.world_from_camera.col(2));
        REQUIRE(pixel);
        CHECK((*pixel - Vec2d(252, 189)).norm() < 250);
    }
}
