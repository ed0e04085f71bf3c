// SPDX-License-Identifier: Apache-2.0
// Checkpoints that a second thread writes while training goes on.
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include "trainer/checkpoint.h"

namespace nerfvdb {

/// One file, one write at a time.
class CheckpointWriter {
public:
    explicit CheckpointWriter(std::filesystem::path path) : path_(std::move(path)) {}
    /// Waits for the write under way.
    ~CheckpointWriter();
    CheckpointWriter(const CheckpointWriter&) = delete;
    CheckpointWriter& operator=(const CheckpointWriter&) = delete;

    /// Begins to write a checkpoint; the one before must be over (isBusy).
    void begin(PackedCheckpoint packed);
    bool isBusy() const { return thread_.joinable() && !is_over_; }
    void wait();
    /// What became of the last write, once, when it is over: why it failed, or empty.
    std::optional<std::string> outcome();

private:
    const std::filesystem::path path_;
    std::thread thread_;
    std::atomic<bool> is_over_{false};
    std::string error_;  // of the write, to be read when it is over
};

}  // namespace nerfvdb
