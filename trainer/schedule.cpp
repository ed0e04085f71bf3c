// SPDX-License-Identifier: Apache-2.0
#include "trainer/schedule.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/error.h"

namespace nerfvdb {

namespace {

constexpr int kBatch[kMaxLevels] = {512, 1024, 4096, 8192};
// However short the training, fog is carved away while rays are cheap, or it is learned, voxel by fine voxel.
constexpr double kCarvingRays[2] = {0.4e6, 1.5e6};

}  // namespace

std::vector<Stage> defaultStages(int n_levels, double rays, double space) {
    // Many small batches while space is being carved, large ones once there is detail to learn: at 64 voxels a
    // large batch prunes nothing.
    constexpr double kCoarse[2] = {0.02, 0.04};  // of the time, when there are all levels, ...
    constexpr double kMiddle = 0.29;             // ... for all between these and the finest
    constexpr double kMostCarving[2] = {0.1, 0.3};  // of the time
    if (n_levels < 1 || n_levels > kMostLevels)
        throw UsageError("schedule: levels must be 1 to " + std::to_string(kMostLevels));
    const auto shareOf = [&](int level) {
        if (level >= 2) return kMiddle / std::max(1, n_levels - 3);
        const double carving = space * kCarvingRays[level] * relativeRayCost(level) / (rays * relativeRayCost(n_levels - 1));
        return std::max(kCoarse[level], std::min(carving, kMostCarving[level]));
    };
    std::vector<Stage> stages;
    double begin = 0;
    for (int level = 0; level < n_levels; ++level) {
        const bool is_finest = level + 1 == n_levels;
        const double end = is_finest ? 1.0 : begin + shareOf(level);
        const int n_parts = is_finest ? 2 : 1;
        for (int part = 0; part < n_parts; ++part)
            stages.push_back({level, kBatch[std::min(level, kMaxLevels - 1)], (end - begin) / n_parts, 0});
        begin = end;
    }
    return stages;
}

std::int64_t mostSteps(const Stage& stage, double space) {
    if (stage.level > 0) return std::numeric_limits<std::int64_t>::max();
    return std::llround(space * kCarvingRays[0] / stage.batch);
}

double relativeRayCost(int level) {
    constexpr double kCost[kMaxLevels] = {1.0, 1.15, 1.5, 2.1};
    constexpr double kGrowth = 1.3;  // beyond: fewer samples are in the cache
    return kCost[std::clamp(level, 0, kMaxLevels - 1)] * std::pow(kGrowth, std::max(0, level - (kMaxLevels - 1)));
}

void planSteps(std::vector<Stage>& stages, std::int64_t total, double space) {
    const auto weight = [](const Stage& stage) { return stage.share / (stage.batch * relativeRayCost(stage.level)); };
    double sum = 0, left = static_cast<double>(total);
    for (const Stage& stage : stages) sum += weight(stage);
    double exact = 0;
    std::int64_t given = 0;
    for (Stage& stage : stages) {
        // The coarsest come first: all others share what they leave.
        if (stages.back().level > 0 && std::llround(left * weight(stage) / sum) > mostSteps(stage, space)) {
            stage.steps = mostSteps(stage, space);
            left -= static_cast<double>(stage.steps);
            sum -= weight(stage);
            continue;
        }
        exact += left * weight(stage) / sum;
        stage.steps = std::llround(exact) - given;
        given += stage.steps;
    }
}

int levelsForRays(double rays, int max_levels) {
    constexpr double kNeeded[kMaxLevels] = {0, 2e4, 4e5, 20e6};
    int levels = 1;
    while (levels < std::min(max_levels, kMaxLevels) && rays >= kNeeded[levels]) ++levels;
    return levels;
}

namespace {

std::vector<Stage> plannedStages(std::int64_t total, int levels, double space) {
    std::vector<Stage> stages = defaultStages(levels, std::numeric_limits<double>::infinity(), space);
    planSteps(stages, total, space);
    stages = defaultStages(levels, raysOf(stages), space);
    planSteps(stages, total, space);
    return stages;
}

}  // namespace

std::vector<Stage> stagesOfLevels(std::int64_t total, int levels, double space) {
    std::vector<Stage> stages = plannedStages(total, levels, space);
    if (total < static_cast<std::int64_t>(stages.size()))
        throw UsageError("--steps", std::to_string(total),
                         "at least " + std::to_string(stages.size()) + ", one in each stage of " + std::to_string(levels) +
                             " levels");
    // What no step has looked at would be taken for unseen.
    for (Stage& stage : stages)
        if (stage.steps < 1) {
            --std::max_element(stages.begin(), stages.end(), [](const Stage& a, const Stage& b) {
                  return a.steps < b.steps;
              })->steps;
            stage.steps = 1;
        }
    return stages;
}

std::vector<Stage> stagesForSteps(std::int64_t total, int max_levels, double space) {
    for (int levels = max_levels;; --levels) {
        const std::vector<Stage> stages = plannedStages(total, levels, space);
        if (levelsForRays(raysOf(stages), levels) == levels) return stages;
    }
}

double raysOf(const std::vector<Stage>& stages) {
    double rays = 0;
    for (const Stage& stage : stages) rays += static_cast<double>(stage.steps) * stage.batch;
    return rays;
}

void planTime(std::vector<Stage>& stages, std::size_t first, std::int64_t done, double step_seconds, double seconds,
              double space) {
    const auto cost = [](const Stage& stage) { return stage.batch * relativeRayCost(stage.level); };
    double shares = 0;
    for (std::size_t s = first; s < stages.size(); ++s) shares += stages[s].share;
    double left = std::max(0.0, seconds) + static_cast<double>(done) * step_seconds;
    for (std::size_t s = first; s < stages.size(); ++s) {
        const std::int64_t over = s == first ? done : 0;
        const double stage_step_seconds = step_seconds * cost(stages[s]) / cost(stages[first]);
        const double steps = left * stages[s].share / shares / stage_step_seconds;
        const auto planned = static_cast<std::int64_t>(std::llround(steps));
        const bool has_finer = stages.back().level > 0;
        stages[s].steps = std::max({std::int64_t{1}, over,
                                    has_finer ? std::min(planned, mostSteps(stages[s], space)) : planned});
        left = std::max(0.0, left - static_cast<double>(stages[s].steps) * stage_step_seconds);
        shares -= stages[s].share;
    }
}

void leaveTimeToCarve(std::vector<Stage>& stages, double step_seconds, double seconds) {
    constexpr double kSteps = 1000, kMost = 0.25;  // of the time
    const double wanted = seconds > 0 ? std::min(kMost, kSteps * step_seconds / seconds) : kMost;
    Stage& first = stages.front();
    if (stages.size() < 2 || first.share >= wanted) return;
    const double rest = (1 - wanted) / (1 - first.share);
    for (Stage& stage : stages) stage.share *= rest;
    first.share = wanted;
}

std::string scheduleText(const std::vector<Stage>& stages) {
    std::string text;
    for (const Stage& stage : stages) {
        if (!text.empty()) text += ',';
        text += std::to_string(stage.steps);
    }
    return text;
}

double progressAt(const std::vector<Stage>& stages, std::size_t stage, std::int64_t step_in_stage) {
    double done = 0, total = 0;
    for (std::size_t s = 0; s < stages.size(); ++s) {
        const double step = stages[s].batch * relativeRayCost(stages[s].level);
        total += static_cast<double>(stages[s].steps) * step;
        if (s <= stage) done += static_cast<double>(s < stage ? stages[s].steps : step_in_stage) * step;
    }
    return total > 0 ? std::min(done / total, 1.0) : 0;
}

double rateFactor(double progress) {
    constexpr double kHeld = 0.6;    // of the training
    constexpr double kFinal = 0.07;  // at its end
    return std::pow(kFinal, std::clamp((progress - kHeld) / (1 - kHeld), 0.0, 1.0));
}

double distortionFactor(double progress) {
    constexpr double kFull = 0.4;  // of the training
    return std::clamp(progress / kFull, 0.0, 1.0);
}

double entropyFactor(double progress) {
    constexpr double kOver = 0.6;  // of the training
    return std::clamp(1 - progress / kOver, 0.0, 1.0);
}

double skySmoothingFactor(double progress) { return std::pow(60.0, progress); }

}  // namespace nerfvdb
