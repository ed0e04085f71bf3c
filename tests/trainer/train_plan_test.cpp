// SPDX-License-Identifier: Apache-2.0
#include "trainer/train_plan.h"

#include <cmath>
#include <numbers>

#include "core/error.h"
#include "tests/support/catch.h"

namespace nerfvdb {

TEST_CASE("levels of an asked voxel begin with 32 to 64 voxels along the box and end with the asked one") {
    for (const double side : {1.0, 7.3, 234.5})
        for (int finest = 64; finest <= 16384; finest = finest * 5 / 4) {
            const double voxel = side / finest;
            const int levels = levelsForVoxel(side, voxel);
            const double coarsest = std::ldexp(voxel, levels - 1);
            CAPTURE(side, finest, levels);
            REQUIRE(side / coarsest <= kCoarsestResolution * (1 + 1e-6));
            REQUIRE(side / coarsest > kCoarsestResolution / 2);
        }
}

TEST_CASE("voxels that levels cannot make are refused with the range that they can") {
    for (const double voxel : {0.0, -1.0, 1e-9, 0.2, 1e9, std::nan("")})
        REQUIRE_THROWS_WITH(levelsForVoxel(1.0, voxel), Catch::Contains("--voxel-size") && Catch::Contains("--bounds"));
}

TEST_CASE("levels end where a voxel is less than what a pixel shows") {
    Dataset dataset;
    for (int n = 0; n < 5; ++n) {
        View view;
        view.camera = lookAt({10, 0, 0}, {0, 0, 0}, {0, 0, 1}, 2 * std::atan(0.5), 100, 100);  // a focal length of 100
        dataset.views.push_back(view);
    }
    const Box box{{-1, -1, -1}, {1, 1, 1}};  // a pixel spans 0.1 in its middle
    REQUIRE(usefulLevels(dataset, box, 0.05) == 1);
    REQUIRE(usefulLevels(dataset, box, 0.13) == 2);
    REQUIRE(usefulLevels(dataset, box, 0.5) == 4);
    REQUIRE(usefulLevels(dataset, box, 100) == kMaxLevels);
}

TEST_CASE("stages follow from the steps given, from their sum, or from the preset") {
    TrainOptions options;
    options.preset = Preset::fast;
    REQUIRE(raysOf(planStages(options, 4, 1)) > 0);
    options.steps = {1, 2, 3, 4, 5};
    std::vector<Stage> stages = planStages(options, 4, 1);
    REQUIRE(scheduleText(stages) == "1,2,3,4,5");
    REQUIRE(stages[3].level == 3);
    REQUIRE(stages[4].level == 3);

    options.steps = {1000};
    std::int64_t sum = 0;
    for (const Stage& stage : planStages(options, 4, 1)) sum += stage.steps;
    REQUIRE(sum == 1000);

    options.steps = {5, 0};
    REQUIRE_THROWS_WITH(planStages(options, 4, 1), Catch::Contains("at least one step in each stage"));
    options.steps = {1, 1, 1, 1, 1, 1};
    REQUIRE_THROWS_WITH(planStages(options, 4, 1), Catch::Contains("6 stages"));
    options.voxel_size = 0.1;
    REQUIRE(planStages(options, 5, 1).back().level == 4);
    REQUIRE_THROWS_WITH(planStages(options, 6, 1), Catch::Contains("--voxel-size needs 6 levels"));
}

TEST_CASE("a short time has the network of fast, and is planned by the clock") {
    TrainOptions options;
    REQUIRE_FALSE(plansTime(options));
    options.time_s = 60;
    REQUIRE(plansTime(options));
    REQUIRE(presetPlan(options).decoder_width < presetPlan({}).decoder_width);
    options.time_s = 600;
    REQUIRE(presetPlan(options).decoder_width == presetPlan({}).decoder_width);
    options.steps = {100};
    REQUIRE_FALSE(plansTime(options));
}

}  // namespace nerfvdb
