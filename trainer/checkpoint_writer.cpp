// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint_writer.h"

#include <new>
#include <utility>

namespace nerfvdb {

CheckpointWriter::~CheckpointWriter() { wait(); }

void CheckpointWriter::begin(PackedCheckpoint packed) {
    wait();
    is_over_ = false;
    error_.clear();
    thread_ = std::thread([this, packed = std::move(packed)]() mutable {
        try {
            saveCheckpoint(path_, packed);
        } catch (const std::bad_alloc&) {
            error_ = path_.string() + ": found no memory to write it";
        } catch (const std::exception& error) {
            error_ = error.what();
        }
        packed = {};  // before anyone sees that it is over
        is_over_ = true;
    });
}

void CheckpointWriter::wait() {
    if (thread_.joinable()) thread_.join();
}

std::optional<std::string> CheckpointWriter::outcome() {
    if (!is_over_) return {};
    wait();
    is_over_ = false;
    return std::exchange(error_, {});
}

}  // namespace nerfvdb
