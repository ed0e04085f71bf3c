// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint_keeper.h"

#include <algorithm>
#include <new>
#include <system_error>

#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr double kMostShare = 0.02;  // of the time that checkpoints halt training

}  // namespace

bool CheckpointKeeper::isDue() {
    if (path_.empty()) return false;
    takeOutcome(writer_.outcome());
    return !writer_.isBusy() && clock_.seconds() - last_saved_ >= std::max(interval_s_, halted_ / kMostShare);
}

void CheckpointKeeper::saveMeanwhile(const TrainState& state, const TrainPlace& place, bool can_copy) {
    const double begin = clock_.seconds();
    if (!can_copy || !beginCopy(state, place)) saveNow(state, place);
    last_saved_ = clock_.seconds();
    halted_ = last_saved_ - begin;
    all_halted_ += halted_;
    ++count_;
}

bool CheckpointKeeper::beginCopy(const TrainState& state, const TrainPlace& place) {
    try {
        writer_.begin(packCheckpoint(state, place));
        return true;
    } catch (const std::bad_alloc&) {
        return false;
    } catch (const std::system_error&) {  // no thread to be had
        return false;
    }
}

void CheckpointKeeper::saveNow(const TrainState& state, const TrainPlace& place) {
    if (path_.empty()) return;
    finish();
    try {
        saveCheckpoint(path_, state, place);
        takeOutcome(std::string());
    } catch (const IoError& error) {
        takeOutcome(error.what());
    }
}

void CheckpointKeeper::finish() {
    writer_.wait();
    takeOutcome(writer_.outcome());
}

void CheckpointKeeper::takeOutcome(const std::optional<std::string>& error) {
    if (!error) return;
    if (error->empty()) has_file_ = true;
    else if (error_.empty()) report_.warn("checkpoint not written, training goes on: " + *error);
    error_ = *error;
}

}  // namespace nerfvdb
