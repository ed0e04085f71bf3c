// SPDX-License-Identifier: Apache-2.0
// From what the user asks for to levels, stages and the size of what a voxel holds.
#pragma once

#include <cstdint>
#include <vector>

#include "trainer/dataset.h"
#include "trainer/schedule.h"
#include "trainer/train_options.h"

namespace nerfvdb {

/// What a preset stands for.
struct PresetPlan {
    std::int64_t steps;  // about one, five and thirty minutes on two cores for a scene like a small object
    int max_levels;
    // How much a voxel and the network hold: what `best` has costs twice the time a ray and 1.7 times the memory, and
    // gains where there is time for it (docs/quality.md).
    int channels, decoder_width;
};
PresetPlan presetPlan(const TrainOptions& options);

/// Number of levels after which a voxel is smaller than what a pixel shows at the middle of the box.
int usefulLevels(const Dataset& dataset, const Box& box, double coarsest_voxel);

/// Number of levels that end with voxels of the asked edge, the coarsest with 32 to 64 of them along the longest side.
/// Throws UsageError for voxels larger or smaller than levels can make.
int levelsForVoxel(double side, double voxel_size);

/// Whether the stages follow from a wish for time: those of planStages are then a guess, enough for the first to be
/// measured in.
inline bool plansTime(const TrainOptions& options) { return options.time_s && options.steps.empty(); }

/// The stages of a training that has up to `max_levels` levels, or just as many with a voxel size, in `space` times the
/// cells of one full box. Throws UsageError for steps that fit no stages.
std::vector<Stage> planStages(const TrainOptions& options, int max_levels, double space);

}  // namespace nerfvdb
