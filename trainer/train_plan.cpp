// SPDX-License-Identifier: Apache-2.0
#include "trainer/train_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/median.h"
#include "vdb/decoder.h"
#include "vdb/topology.h"

namespace nerfvdb {
namespace {

constexpr double kVoxelPerPixel = 0.6;  // voxels smaller than this share of a pixel's width show nothing new

PresetPlan planOf(Preset preset) {
    switch (preset) {
        case Preset::fast: return {10000, 3, 8, kDecoderWidth / 2};
        case Preset::standard: return {20000, 4, 8, kDecoderWidth};
        case Preset::best: return {57000, 4, 16, 2 * kDecoderWidth};
    }
    throw UsageError("training: an unknown preset");
}

std::vector<Stage> stagesFromSteps(const std::vector<std::int64_t>& steps) {
    std::vector<Stage> stages = defaultStages(static_cast<int>(steps.size()) - 1, /*rays=*/1);
    for (std::size_t s = 0; s < steps.size(); ++s) stages[s].steps = steps[s];
    return stages;
}

}  // namespace

PresetPlan presetPlan(const TrainOptions& options) {
    PresetPlan plan = planOf(options.preset.value_or(Preset::standard));
    // At large voxels the network is a fifth of the time, and rays are worth more than its width.
    constexpr double kShort = 90;
    if (!options.preset && plansTime(options) && *options.time_s <= kShort)
        plan.decoder_width = planOf(Preset::fast).decoder_width;
    return plan;
}

int usefulLevels(const Dataset& dataset, const Box& box, double coarsest_voxel) {
    std::vector<double> pixel_sizes;
    for (const View& view : dataset.views)
        pixel_sizes.push_back((view.camera.position - box.center()).norm() / view.camera.fx);
    const double smallest = kVoxelPerPixel * medianOf(std::move(pixel_sizes));
    int levels = 1;
    while (levels < kMaxLevels && coarsest_voxel / (1 << levels) >= smallest) ++levels;
    return levels;
}

int levelsForVoxel(double side, double voxel_size) {
    const double finest = side / std::ldexp(kCoarsestResolution, kMostLevels - 1), coarsest = side / kLeafDim;
    if (!(voxel_size >= finest) || !(voxel_size <= coarsest)) {
        char found[64], expected[96];
        std::snprintf(found, sizeof found, "%.4g world units", voxel_size);
        std::snprintf(expected, sizeof expected, "%.4g to %.4g, for a box %.4g long", finest, coarsest, side);
        throw UsageError("--voxel-size", found, expected, "--bounds says which box");
    }
    int levels = 1;
    while (std::ldexp(voxel_size, levels - 1) * kCoarsestResolution < side * (1 - 1e-9)) ++levels;
    return levels;
}

std::vector<Stage> planStages(const TrainOptions& options, int max_levels, double space) {
    const std::vector<std::int64_t>& steps = options.steps;
    for (const std::int64_t n : steps)
        if (n < 1) throw UsageError("--steps", std::to_string(n), "at least one step in each stage");
    if (steps.size() <= 1) {
        const std::int64_t total = steps.empty() ? presetPlan(options).steps : steps.front();
        return options.voxel_size ? stagesOfLevels(total, max_levels, space) : stagesForSteps(total, max_levels, space);
    }
    if (options.voxel_size && steps.size() != static_cast<std::size_t>(max_levels) + 1)
        throw UsageError("--steps", std::to_string(steps.size()) + " stages",
                         std::to_string(max_levels + 1) + ", as --voxel-size needs " + std::to_string(max_levels) + " levels",
                         "give one number for a default plan");
    if (!options.voxel_size && steps.size() > kMaxLevels + 1)
        throw UsageError("--steps", std::to_string(steps.size()) + " stages", "2 to " + std::to_string(kMaxLevels + 1),
                         "give one number for a default plan");
    return stagesFromSteps(steps);
}

}  // namespace nerfvdb
