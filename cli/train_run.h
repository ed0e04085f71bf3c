// SPDX-License-Identifier: Apache-2.0
// One training from photographs to files: a model, its checkpoint and its log. All of `train`, or one block of it.
#pragma once

#include <filesystem>
#include <string>

#include "cli/json_output.h"
#include "core/report.h"
#include "trainer/dataset.h"
#include "trainer/trainer.h"

namespace nerfvdb {

struct TrainRun {
    std::filesystem::path data;
    std::filesystem::path out;    // MODEL.vdb; MODEL.ckpt and MODEL.csv lie beside it
    std::filesystem::path cache;  // folder for photographs that memory has no room for; empty: that of `out`
    DatasetOptions photographs;
    TrainOptions options;
    bool resume = false;
};

/// What became of it. The files are written; what kept them from being all that was asked for is still to be thrown.
struct TrainOutcome {
    Json json;
    std::string text;
    std::string stopped;           // where it was stopped, as asked; empty: it was not
    std::string numeric_error;     // TrainResult's
    std::string checkpoint_error;  // TrainResult's

    bool isWhole() const { return stopped.empty() && numeric_error.empty() && checkpoint_error.empty(); }
};

/// The checkpoint, or the log, that belongs to a model.
std::filesystem::path besideModel(const std::filesystem::path& model, const char* extension);

/// Before long work: throws UsageError or IoError for outputs that cannot be written, and where there is nothing to resume.
void checkOutputs(const TrainRun& run);

/// Trains and saves. Throws as readDataset, train and saveModel do.
TrainOutcome trainToFiles(const TrainRun& run, Report& report);

/// Throws what was left: NumericError, IoError, or Interrupted with the command that goes on.
void throwUnlessWhole(const TrainOutcome& outcome, const std::filesystem::path& out, const std::string& to_go_on);

}  // namespace nerfvdb
