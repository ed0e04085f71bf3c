// SPDX-License-Identifier: Apache-2.0
#include "trainer/schedule.h"

#include <cmath>

#include "core/error.h"
#include "tests/support/catch.h"
#include "trainer/train_step.h"

using namespace nerfvdb;

namespace {

std::int64_t totalSteps(const std::vector<Stage>& stages) {
    std::int64_t total = 0;
    for (const Stage& stage : stages) total += stage.steps;
    return total;
}

double stepCost(const Stage& stage) { return stage.batch * relativeRayCost(stage.level); }

}  // namespace

TEST_CASE("stages go from coarse to fine, share all of the time, and end with two of the finest level") {
    for (int levels = 1; levels <= kMaxLevels; ++levels)
        for (const double rays : {1.0, 1e6, 1e8}) {
            CAPTURE(levels, rays);
            const std::vector<Stage> stages = defaultStages(levels, rays);
            REQUIRE(stages.size() == static_cast<std::size_t>(levels + 1));
            double shares = 0;
            for (std::size_t s = 0; s < stages.size(); ++s) {
                CHECK(stages[s].level == std::min(static_cast<int>(s), levels - 1));
                CHECK(stages[s].share > 0);
                shares += stages[s].share;
            }
            CHECK(shares == Approx(1));
        }
    CHECK_THROWS_AS(defaultStages(0, 1e6), UsageError);
}

TEST_CASE("planned steps sum to the total, in proportion to share over cost") {
    for (int levels = 1; levels <= kMaxLevels; ++levels)
        for (const std::int64_t total : {1, 2, 7, 100, 4500, 110000}) {
            CAPTURE(levels, total);
            std::vector<Stage> stages = defaultStages(levels, 1e7);
            planSteps(stages, total);
            CHECK(totalSteps(stages) == total);
            double weights = 0, left = static_cast<double>(total);
            const auto hasEnough = [&](const Stage& stage) { return levels > 1 && stage.steps >= mostSteps(stage); };
            for (const Stage& stage : stages) {
                if (hasEnough(stage)) left -= static_cast<double>(stage.steps);
                else weights += stage.share / stepCost(stage);
            }
            for (const Stage& stage : stages) {
                CHECK(stage.steps >= 0);
                if (levels > 1) CHECK(stage.steps <= mostSteps(stage));
                // Rounded at both ends.
                if (!hasEnough(stage))
                    CHECK(std::abs(stage.steps - left * stage.share / stepCost(stage) / weights) <= 1.0);
            }
        }
}

TEST_CASE("short trainings carve longer: enough rays at coarse voxels, but never most of the time") {
    const auto coarseRays = [](std::int64_t total) {
        const std::vector<Stage> stages = stagesForSteps(total, kMaxLevels);
        REQUIRE(stages.back().level >= 2);
        CHECK(stages[0].share + stages[1].share < 0.41);
        return static_cast<double>(stages[0].steps * stages[0].batch + stages[1].steps * stages[1].batch);
    };
    for (const std::int64_t total : {4500, 10000, 100000}) {
        CAPTURE(total);
        CHECK(coarseRays(total) > 0.8 * (0.4e6 + 1.5e6));  // asked for by the plan before this one, of more rays
    }
    const std::vector<Stage> a_long_one = stagesForSteps(100000, kMaxLevels);
    CHECK(a_long_one[0].share == Approx(0.02).epsilon(0.01));
    CHECK(a_long_one[1].share == Approx(0.04).epsilon(0.01));
}

TEST_CASE("however long the training, the coarsest voxels get what carves them and no more; space that is larger gets more") {
    const std::int64_t enough = mostSteps(defaultStages(kMaxLevels, 1e8).front());
    CHECK(enough > 100);
    for (const std::int64_t total : {100000, 1000000}) {
        const std::vector<Stage> stages = stagesForSteps(total, kMaxLevels);
        CHECK(stages.front().steps == enough);
        CHECK(totalSteps(stages) == total);
    }
    CHECK(stagesForSteps(1000000, kMaxLevels, 3).front().steps == Approx(3 * enough).margin(2));
    CHECK(stagesOfLevels(100000, 1)[0].steps == 50000);  // where there are no finer ones

    // Also by time: what it does not need goes to the others.
    std::vector<Stage> stages = defaultStages(kMaxLevels, 1e8);
    const double step_seconds = 0.003, seconds = 10000;
    planTime(stages, 0, 40, step_seconds, seconds);
    CHECK(stages.front().steps == enough);
    double planned = -40 * step_seconds;
    for (const Stage& stage : stages) planned += static_cast<double>(stage.steps) * step_seconds * stepCost(stage) / stepCost(stages[0]);
    CHECK(planned == Approx(seconds).epsilon(1e-3));
}

TEST_CASE("the steps of a plan, given by hand, are the same plan") {
    for (const std::int64_t total : {40, 900, 4500, 18000}) {
        const std::vector<Stage> planned = stagesForSteps(total, kMaxLevels);
        std::vector<Stage> by_hand = defaultStages(planned.back().level + 1, 1);
        for (std::size_t s = 0; s < planned.size(); ++s) by_hand[s].steps = planned[s].steps;
        for (std::size_t s = 0; s < planned.size(); ++s)
            for (const std::int64_t step : {std::int64_t{0}, planned[s].steps / 2, planned[s].steps})
                CHECK(progressAt(by_hand, s, step) == progressAt(planned, s, step));
    }
}

TEST_CASE("more rays never mean fewer levels, and a plan has the levels that its own rays deserve") {
    int last = 1;
    for (double rays = 1; rays < 1e9; rays *= 1.5) {
        const int levels = levelsForRays(rays, kMaxLevels);
        CHECK(levels >= last);
        CHECK(levelsForRays(rays, 2) == std::min(levels, 2));
        last = levels;
    }
    CHECK(last == kMaxLevels);
    for (const std::int64_t total : {1, 50, 600, 4500, 18000, 110000})
        for (int most = 1; most <= kMaxLevels; ++most) {
            const std::vector<Stage> stages = stagesForSteps(total, most);
            CHECK(totalSteps(stages) == total);
            CHECK(levelsForRays(raysOf(stages), stages.back().level + 1) == stages.back().level + 1);
            CHECK(stages.back().level < most);
        }
}

TEST_CASE("no level is left before a step has looked at it: what no ray has seen is not refined") {
    for (std::int64_t total = 1; total <= 3000; ++total) {
        const std::vector<Stage> stages = stagesForSteps(total, kMaxLevels);
        for (const Stage& stage : stages) {
            CAPTURE(total, stage.level);
            REQUIRE((stage.steps >= 1 || stage.level == stages.back().level));
        }
    }
}

TEST_CASE("steps planned for a time take that time by the cost model") {
    for (const std::size_t first : {0, 2}) {
        std::vector<Stage> stages = defaultStages(kMaxLevels, 1e8);
        for (Stage& stage : stages) stage.steps = 10;
        const double step_seconds = 0.01, seconds = 200;
        planTime(stages, first, 5, step_seconds, seconds);
        double planned = -5 * step_seconds;  // five are over
        for (std::size_t s = first; s < stages.size(); ++s)
            planned += stages[s].steps * step_seconds * stepCost(stages[s]) / stepCost(stages[first]);
        // Half a step of each stage is rounded; the longest takes 0.34 s.
        CHECK(std::abs(planned - seconds) < 0.5);
        for (std::size_t s = 0; s < first; ++s) CHECK(stages[s].steps == 10);
    }
}

TEST_CASE("without time left a stage ends, and each later one still gets a step") {
    std::vector<Stage> stages = defaultStages(3, 1e7);
    planTime(stages, 1, 40, 0.01, -3);
    CHECK(stages[1].steps == 40);
    CHECK(stages[2].steps == 1);
    CHECK(stages[3].steps == 1);
}

TEST_CASE("planned anew at the same cost, a stage has the steps that it had, however few were planned") {
    for (const double seconds : {1.0, 20.0, 600.0}) {
        std::vector<Stage> stages = defaultStages(7, 1e7);
        const double step_seconds = 0.01;
        planTime(stages, 2, 0, step_seconds, seconds);
        const std::int64_t planned = stages[2].steps;
        for (std::int64_t done = 1; done <= std::min<std::int64_t>(planned, 40); ++done) {
            CAPTURE(seconds, done);
            planTime(stages, 2, done, step_seconds, seconds - static_cast<double>(done) * step_seconds);
            CHECK(std::abs(stages[2].steps - planned) <= 1);
        }
    }
}

TEST_CASE("progress runs from 0 to 1 without a step back or a leap") {
    std::vector<Stage> stages = stagesForSteps(4500, kMaxLevels);
    double last = 0, work = 0;
    for (const Stage& stage : stages) work += static_cast<double>(stage.steps) * stepCost(stage);
    CHECK(progressAt(stages, 0, 0) == 0);
    for (std::size_t s = 0; s < stages.size(); ++s)
        for (std::int64_t step = 0; step <= stages[s].steps; ++step) {
            const double progress = progressAt(stages, s, step);
            CHECK(progress >= last - 1e-12);
            CHECK(progress <= last + stepCost(stages[s]) / work + 1e-12);
            last = progress;
        }
    CHECK(last == Approx(1));
}

TEST_CASE("a schedule's text names the steps of each stage") {
    std::vector<Stage> stages = defaultStages(2, 1e7);
    stages[0].steps = 120, stages[1].steps = 300, stages[2].steps = 9000000000;
    CHECK(scheduleText(stages) == "120,300,9000000000");
}

TEST_CASE("time to carve is a thousand steps, or a quarter of all, and other stages keep their proportions") {
    const std::vector<Stage> stages = defaultStages(4, 1e9);
    const auto carved = [&](double step_seconds) {
        std::vector<Stage> changed = stages;
        leaveTimeToCarve(changed, step_seconds, /*seconds=*/100);
        double sum = 0;
        for (const Stage& stage : changed) sum += stage.share;
        CHECK(sum == Approx(1));
        for (std::size_t s = 2; s < stages.size(); ++s)
            CHECK(changed[s].share / changed[1].share == Approx(stages[s].share / stages[1].share));
        return changed.front().share;
    };
    CHECK(carved(0.01) == Approx(0.1));
    CHECK(carved(0.02) == Approx(0.2));
    CHECK(carved(0.03) == Approx(0.25));
    CHECK(carved(1) == Approx(0.25));
    CHECK(carved(1e-4) == stages.front().share);  // has it already
}

TEST_CASE("the distortion loss grows evenly from nothing, and is whole before rates fall") {
    CHECK(distortionFactor(0) == 0);
    for (double progress = 0; progress < 1; progress += 0.01)
        CHECK(distortionFactor(progress + 0.01) >= distortionFactor(progress));
    CHECK(distortionFactor(0.2) == 0.5);
    CHECK(distortionFactor(0.5) == 1);
    CHECK(rateFactor(0.5) == 1);
    CHECK(distortionFactor(1.1) == 1);
}

TEST_CASE("the entropy of opacity shrinks evenly to nothing, and is gone when rates fall") {
    CHECK(entropyFactor(0) == 1);
    CHECK(entropyFactor(0.3) == Approx(0.5));
    for (double progress = 0; progress < 1; progress += 0.01)
        CHECK(entropyFactor(progress + 0.01) <= entropyFactor(progress));
    CHECK(entropyFactor(0.61) == 0);
    CHECK(rateFactor(0.59) == 1);
    CHECK(entropyFactor(1.1) == 0);
}

TEST_CASE("the sky is smoothed as it always was at first, and more and more, but never past its neighbours' mean") {
    CHECK(skySmoothingFactor(0) == 1);
    for (double progress = 0; progress < 1; progress += 0.01)
        CHECK(skySmoothingFactor(progress + 0.01) > skySmoothingFactor(progress));
    CHECK(skySmoothingFactor(1) == Approx(60));
    CHECK(StepRates{}.sky_smoothing * skySmoothingFactor(1) < 1);
}

TEST_CASE("rates stay, then fall without a jump, and end well above zero") {
    CHECK(rateFactor(0) == 1);
    CHECK(rateFactor(0.5) == 1);
    CHECK(rateFactor(1) > 0.01);
    CHECK(rateFactor(1) < 0.2);
    CHECK(rateFactor(1.1) == rateFactor(1));
    for (double progress = 0; progress < 1; progress += 0.01) {
        CHECK(rateFactor(progress + 0.01) <= rateFactor(progress));
        CHECK(rateFactor(progress + 0.01) > 0.9 * rateFactor(progress));
    }
}

TEST_CASE("levels that are asked for are planned, however few the rays, and finer ones share the middle of the time") {
    for (int levels = 1; levels <= kMostLevels; ++levels) {
        const std::vector<Stage> stages = stagesOfLevels(3000, levels);
        CHECK(stages.size() == static_cast<std::size_t>(levels) + 1);
        CHECK(stages.back().level == levels - 1);
        CHECK(totalSteps(stages) == 3000);
        double sum = 0;
        for (const Stage& stage : stages) {
            CHECK(stage.share > 0);
            CHECK(stage.batch > 0);
            sum += stage.share;
        }
        CHECK(sum == Approx(1));
        if (levels > kMaxLevels) CHECK(stages[2].share / stages[3].share == Approx(1).epsilon(0.05));  // whole steps
        for (int level = 1; level < levels; ++level) CHECK(relativeRayCost(level) > relativeRayCost(level - 1));
    }
    CHECK_THROWS_AS(defaultStages(kMostLevels + 1, 1e6), UsageError);
    for (std::int64_t total = 8; total < 200; ++total) {  // too few for each stage's share to be a step
        const std::vector<Stage> stages = stagesOfLevels(total, 7);
        CHECK(totalSteps(stages) == total);
        for (const Stage& stage : stages) CHECK(stage.steps >= 1);
    }
    CHECK_THROWS_AS(stagesOfLevels(7, 7), UsageError);
}
