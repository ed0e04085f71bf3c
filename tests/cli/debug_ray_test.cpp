// SPDX-License-Identifier: Apache-2.0
#include "cli/debug_ray.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

Dataset threeViews() {
    Dataset dataset;
    for (const char* path : {"images/r_0.png", "images/r_1.png", "images/C:/r_11.png"}) {
        View view;
        view.path = path;
        view.camera.width = 30, view.camera.height = 20;
        dataset.views.push_back(view);
    }
    return dataset;
}

}  // namespace

TEST_CASE("a pixel is named by the number or the end of the path of its view") {
    const Dataset dataset = threeViews();
    const DebugPixel by_number = parseDebugPixel("1:29:19", dataset);
    CHECK(by_number.view == 1);
    CHECK(by_number.x == 29);
    CHECK(by_number.y == 19);
    CHECK(parseDebugPixel("r_1.png:0:0", dataset).view == 1);
    CHECK(parseDebugPixel("C:/r_11.png:3:4", dataset).view == 2);
    CHECK(by_number.jitter == 0.5f);
}

TEST_CASE("a step's own jitter can be replayed") {
    const Dataset dataset = threeViews();
    const DebugPixel pixel = parseDebugPixel("C:/r_11.png:3:4:0.062500000", dataset);
    CHECK(pixel.view == 2);
    CHECK(pixel.x == 3);
    CHECK(pixel.y == 4);
    CHECK(pixel.jitter == 0.0625f);
}

TEST_CASE("what is no pixel of the data set is refused with the words that were given") {
    const Dataset dataset = threeViews();
    for (const char* text : {"", ":", "::", "1:2", "3:0:0", "-1:0:0", "0:30:0", "0:0:20", "0:-1:0", "0:1.5:0",
                             "0:x:0", "r_2.png:0:0", ":0:0", "0:0:", "0:0:0:1.0", "0:0:0:-0.5", "0:0:0:0.5x", "0:0:.5",
                             "0:0:0:."}) {
        CAPTURE(text);
        CHECK_THROWS_WITH(parseDebugPixel(text, dataset),
                          Catch::Matchers::Contains("--debug-ray: found '" + std::string(text) + "'"));
        CHECK_THROWS_AS(parseDebugPixel(text, dataset), UsageError);
    }
}
