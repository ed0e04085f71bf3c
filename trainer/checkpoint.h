// SPDX-License-Identifier: Apache-2.0
// What training needs to go on exactly where it stopped: full precision, moments, plan and place in it.
// A native binary file, one program version reads its own; the model for everyone else is vdb/model_file.h.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "trainer/schedule.h"
#include "trainer/train_step.h"

namespace nerfvdb {

/// Where training stands.
struct TrainPlace {
    std::vector<Stage> stages;
    std::size_t stage = 0;             // current
    std::int64_t step = 0;             // done in all
    std::int64_t step_in_stage = 0;    // done in the current stage
    std::int64_t next_occupancy = 0;   // step of the stage at which occupancy is due
    std::uint64_t rays = 0;            // drawn so far
    double mean_error = 0;             // squared error, exponential mean over steps
    std::uint64_t seed = 0;
    int n_views = 0;                   // of the data set ...
    std::string data_hash;             // ... and its datasetHash, to refuse another one
    bool tries_exposure = false;       // exposures are learned until the first stage shows whether they differ
    bool has_asked_voxels = false;     // someone said how large voxels end
};

/// A checkpoint's bytes but for its head, copied from the state in parallel.
struct PackedCheckpoint {
    std::unique_ptr<std::byte[]> bytes;
    std::size_t size = 0;
};
PackedCheckpoint packCheckpoint(const TrainState& state, const TrainPlace& place);
/// Their number, before anything is copied.
std::size_t checkpointBytes(const TrainState& state, const TrainPlace& place);

/// Layout: "nerfvdb-checkpoint 4\n", 32 hexadecimal digits (content hash of all that follows) and "\n", then the
/// fields in the order of checkpoint.cpp, little-endian. Throws IoError.
void saveCheckpoint(const std::filesystem::path& path, const PackedCheckpoint& packed);
/// The same file, straight from the state: takes a few megabytes, not a copy.
void saveCheckpoint(const std::filesystem::path& path, const TrainState& state, const TrainPlace& place);

/// Throws IoError / DataError: no such file, not a checkpoint, another version, damaged (the hash is verified first).
/// `check` is called when all is there but what the voxels hold, which takes the memory; what it throws ends loading.
void loadCheckpoint(const std::filesystem::path& path, TrainState& state, TrainPlace& place,
                    const std::function<void()>& check = [] {});

}  // namespace nerfvdb
