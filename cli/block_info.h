// SPDX-License-Identifier: Apache-2.0
// What a folder of blocks holds, in words and JSON.
#pragma once

#include <filesystem>

#include "cli/dataset_info.h"

namespace nerfvdb {

/// From blocks.json and the sizes of the models; no model is read. Throws as readBlockIndex.
Description describeBlocks(const std::filesystem::path& path);

}  // namespace nerfvdb
