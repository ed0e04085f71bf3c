// SPDX-License-Identifier: Apache-2.0
// How a scene learns: coarse to fine, stage by stage, step by step.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/report.h"
#include "trainer/dataset.h"
#include "trainer/train_options.h"
#include "vdb/model.h"

namespace nerfvdb {

/// What one interval of training looked like; the CSV log has one line of each.
struct TrainProgress {
    std::int64_t step = 0, total_steps = 0;
    int stage = 0;
    double loss = 0;             // mean squared error of the interval
    double psnr = 0;             // of that loss, dB
    // What else the loss holds, means over the interval's rays, before their weights; 0: not in the loss.
    double distortion = 0, entropy = 0, alpha_error = 0;
    std::uint64_t rays = 0;      // drawn so far
    std::size_t voxels = 0;      // active
    double seconds = 0;          // since training began
    bool has_checkpoint = false;  // the checkpoint's file is of this run
};

struct TrainResult {
    Model model;
    std::int64_t steps = 0;      // done
    bool interrupted = false;    // stopped early on request: the model is whole, but less trained
    std::size_t active_voxels = 0;
    std::vector<double> gains;       // Exposures::gains of the views; empty: exposures were not learned
    std::uint64_t undone_steps = 0;  // that met values which are not finite, and were tried again
    std::string numeric_error;       // why training stopped early although nobody asked; empty: it did not
    std::string checkpoint_error;    // why the last checkpoint could not be written; empty: it was
    int checkpoints = 0;             // written at intervals, and ...
    double checkpoint_seconds = 0;   // ... how long training halted for them
    std::vector<std::string> notes;  // facts for the user: plan, memory limit reached, ...
};

/// Trains on a data set; tells `report` how it goes and calls `on_interval` a few times a minute. The model names the
/// cameras of the data set. It shows the mean of the photographs' exposures.
/// With `checkpoint`, state is loaded from there when `resume`, and saved there at intervals and at the end. Plan,
/// seed, background, exposure and box are then those of the checkpoint, whatever `options` say. A checkpoint that cannot be
/// written is a warning and TrainResult::checkpoint_error, never the end of training. Those at intervals are written
/// by a second thread; the call returns when all is written.
/// Steps that meet values which are not finite are undone and tried again (step_guard.h); three in a row end training
/// with numeric_error: the model is as it was before them, the checkpoint the last that was written.
/// Throws DataError (nothing to learn from, a checkpoint of another data set), NumericError, or Interrupted when the report is
/// cancelled while an object is looked for (object_box.h): there is no model yet.
TrainResult train(const Dataset& dataset, const TrainOptions& options, Report& report,
                  const std::function<void(const TrainProgress&)>& on_interval,
                  const std::filesystem::path& checkpoint = {}, bool resume = false);

}  // namespace nerfvdb
