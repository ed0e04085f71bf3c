// SPDX-License-Identifier: Apache-2.0
// The order of learning: which voxel size, how many rays a step, how fast. Driven by steps, never by the clock,
// so that a slow machine learns the same; a wish for time is turned into steps by a cost model (planSteps).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace nerfvdb {

/// A run of steps at one voxel size.
struct Stage {
    int level = 0;            // 0: kCoarsestResolution voxels along the longest side; each level doubles it
    int batch = 0;            // rays a step
    double share = 0;         // of the training time, wished for: what steps are planned by
    std::int64_t steps = 0;   // 0 until planned
};

inline constexpr int kCoarsestResolution = 64;  // voxels along the longest side at level 0
inline constexpr int kMaxLevels = 4;            // 64 to 512: what is chosen for a scene ...
inline constexpr int kMostLevels = 10;          // ... and what can be asked for

/// Stages for 1 to kMostLevels levels, coarse to fine, for a training of about `rays` rays; the finest level has two
/// (so that its second half can be planned from the cost of its first). Space of `space` times the cells of one full box
/// takes so many times the rays to be carved.
std::vector<Stage> defaultStages(int n_levels, double rays, double space = 1);

/// What a stage among finer ones is given at most, however long the training: at the coarsest voxels the steps that carve
/// them, since what they are too large for is carved away too (docs/quality.md, "Enough of the coarsest voxels").
std::int64_t mostSteps(const Stage& stage, double space = 1);

/// How many levels to use: no more than `max_levels`, and fewer when so few rays will be drawn (per training run)
/// that fine voxels would hardly be looked at. Measured: 512 voxels pay from about 20 million rays on.
int levelsForRays(double rays, int max_levels);

/// Stages for a total of `total` steps; the number of levels follows from levelsForRays ...
std::vector<Stage> stagesForSteps(std::int64_t total, int max_levels, double space = 1);
/// ... or is `levels`, however few rays there are, with at least a step in each stage. Throws UsageError for fewer steps.
std::vector<Stage> stagesOfLevels(std::int64_t total, int levels, double space = 1);

/// Fills in steps so that they sum to `total`, in proportion share / (cost of a step), with the relative cost per
/// ray of a typical scene; what a stage would have beyond mostSteps goes to the others.
void planSteps(std::vector<Stage>& stages, std::int64_t total, double space = 1);

/// Fills in the steps of stages `first` and later so that those that are left take `seconds`, in proportion to their
/// shares, when a step of stage `first` takes `step_seconds`; at least one step each. `done` steps of it are over
/// already, and a part of its share. No stage gets more than mostSteps.
void planTime(std::vector<Stage>& stages, std::size_t first, std::int64_t done, double step_seconds, double seconds,
              double space = 1);

/// Raises the share of the first stage, at the others' cost, so that a thousand steps of `step_seconds` fit into it, but to a
/// quarter of the `seconds` of all at most. Scenes without bounds: there few rays touch most voxels, a step costs much more
/// than the cost of a ray says, and fog that is not carved from shells becomes floaters.
void leaveTimeToCarve(std::vector<Stage>& stages, double step_seconds, double seconds);

/// Relative cost of a ray at a level, 1 at level 0; measured on several scenes.
double relativeRayCost(int level);

/// Rays that all stages draw.
double raysOf(const std::vector<Stage>& stages);

/// "120,300,900,2400,2400"
std::string scheduleText(const std::vector<Stage>& stages);

/// Fraction of the training done after `step_in_stage` steps of stage `stage`, [0, 1]: of the work that its steps are by the
/// cost model, so that losses and rates follow one course whether steps were asked for or planned for a time. Where a new plan
/// has more steps than the last, it falls.
double progressAt(const std::vector<Stage>& stages, std::size_t stage, std::int64_t step_in_stage);

/// What learning rates are multiplied with at this progress: 1 for most of the time, then falling exponentially.
/// Large rates find the scene, small ones take the noise of single batches out of it; to fall from the start on
/// would waste time on rates that are neither.
double rateFactor(double progress);

/// What the distortion loss is multiplied with at this progress: it grows from 0 to 1 over the first two fifths. In full from
/// the start it makes surfaces of fog before photographs have said where they are (docs/quality.md).
double distortionFactor(double progress);

/// What the entropy of opacity is multiplied with at this progress: it falls from 1 to 0 over the first three fifths. Fog is
/// decided early; later it would take from photographs what they show at the borders of things (docs/quality.md).
double entropyFactor(double progress);

/// What the smoothing of the sky is multiplied with at this progress: it grows from 1 to 60. What stands at the border of the
/// pictures, seen from one side, is partly learned as sky, which others than its own photographs then show in pieces; smooth,
/// it is a better guess. But a sky that is smooth from the start blurs horizons for good (docs/quality.md).
double skySmoothingFactor(double progress);

}  // namespace nerfvdb
