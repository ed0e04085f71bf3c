// SPDX-License-Identifier: Apache-2.0
// When a training writes its checkpoints: at intervals, by a second thread where there is memory for a copy, and never
// so often that it costs more than a fiftieth of the time.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/clock.h"
#include "core/report.h"
#include "trainer/checkpoint_writer.h"

namespace nerfvdb {

/// A checkpoint that cannot be written is a warning and error(): what was learned is worth more than its checkpoint.
class CheckpointKeeper {
public:
    /// Without a path nothing is ever written.
    CheckpointKeeper(std::filesystem::path path, double interval_s, Report& report)
        : path_(std::move(path)), interval_s_(interval_s), report_(report), writer_(path_) {}

    /// Whether the interval is over, and the last checkpoint written.
    bool isDue();
    /// Training halts while its state is copied; a second thread writes the copy. Without `can_copy`, or the memory,
    /// training halts until the state is written.
    void saveMeanwhile(const TrainState& state, const TrainPlace& place, bool can_copy);
    void saveNow(const TrainState& state, const TrainPlace& place);
    /// Waits for the second thread.
    void finish();

    /// The file is of this run.
    bool hasFile() const { return has_file_; }
    void setHasFile() { has_file_ = true; }
    /// Why the last checkpoint could not be written; empty: it was.
    const std::string& error() const { return error_; }
    /// Checkpoints at intervals, and how long training halted for all of them.
    int count() const { return count_; }
    double haltedSeconds() const { return all_halted_; }

private:
    bool beginCopy(const TrainState& state, const TrainPlace& place);
    void takeOutcome(const std::optional<std::string>& error);

    const std::filesystem::path path_;
    const double interval_s_;
    Report& report_;
    CheckpointWriter writer_;
    Clock clock_;
    double last_saved_ = 0, halted_ = 0;  // seconds; the second, what the last checkpoint at an interval cost
    double all_halted_ = 0;
    int count_ = 0;
    bool has_file_ = false;
    std::string error_;
};

}  // namespace nerfvdb
