// SPDX-License-Identifier: Apache-2.0
// What can be said about a training before it begins.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

enum class Preset { fast, standard, best };
/// How far a scene goes: to a box, or on without bounds, in shells up to a sky (up to nothing where photographs have
/// alpha). Automatic: without bounds where photographs have neither alpha nor a plain background (plainBackground), and neither
/// background nor bounds are given.
enum class SceneExtent { automatic, box, open };
enum class BackgroundMode { automatic, white, black, random };
enum class ExposureMode { automatic, on, off };

struct TrainOptions {
    std::optional<Preset> preset;               // standard, but for time_s of 90 s and less with the network of fast
    std::optional<double> time_s;               // wall time from process start to file on disk
    std::vector<std::int64_t> steps;            // total number of steps (one entry) or steps per stage (all entries)
    BackgroundMode background = BackgroundMode::automatic;
    ExposureMode exposure = ExposureMode::automatic;  // on where photographs without alpha differ from their neighbours by it
    SceneExtent extent = SceneExtent::automatic;
    std::optional<Box> bounds;                  // world units; of an open scene, its inner box
    std::optional<double> voxel_size;           // world units, at the end (of the inner box); absent: by what photographs show
    std::optional<std::size_t> max_memory_bytes;  // absent: refined as far as the machine's memory reaches
    double checkpoint_s = 60;                   // between checkpoints, and longer where they would halt training for more
                                                // than 2 % of the time
    std::uint64_t seed = 1;
    bool keep_unseen = false;                   // also learn voxels that fewer than two views see, that a mask shows
                                                // empty or from which no ray took light: to measure what they cost
    bool skip_nothing = false;                  // and march through all of the box, to its end, read features at every
                                                // sample, draw every pixel: to measure what all skipping saves
    double rays_to_halve = 8e7;                 // of a training that halves voxels near cameras (resolvedRegions): fewer
                                                // are better spent on the voxels that are there (docs/quality.md)
    double elapsed_s = 0;                       // wall time the process had spent when training began
};

}  // namespace nerfvdb
