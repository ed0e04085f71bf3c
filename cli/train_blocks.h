// SPDX-License-Identifier: Apache-2.0
// The blocks of a scene, trained one after another, or one of them alone.
#pragma once

#include <optional>

#include "cli/block_words.h"
#include "cli/train_run.h"

namespace nerfvdb {

/// Cuts the scene (block_plan.h), writes FOLDER/blocks.json and trains each block to FOLDER/block_I_J.vdb, `run.out` being
/// the folder. A block that is done keeps no checkpoint: with `run.resume`, what is done stays, what was begun goes on.
/// `run.options.time_s` is shared out by photographs. Stops at the first block that is not whole.
/// Throws UsageError, DataError (a block with too few photographs that is asked for alone), and as trainToFiles.
TrainOutcome trainBlocks(const TrainRun& run, const BlockCount& count, const std::optional<BlockId>& only,
                         Report& report);

}  // namespace nerfvdb
