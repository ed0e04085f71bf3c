// SPDX-License-Identifier: Apache-2.0
// What a data set holds, for people and for programs: its views, what its cameras cover, a picture of them.
#pragma once

#include <filesystem>
#include <string>

#include "cli/json_output.h"
#include "core/types.h"

namespace nerfvdb {

struct Description {
    Json json;
    std::string text;
};

/// Describes the splits of a data set and the capture as a whole; unusable cameras are named, not refused. Writes a
/// picture of the cameras to `plot_path` unless that is empty. Throws as readDataset for the training split.
Description describeDataset(const std::filesystem::path& path, const std::filesystem::path& plot_path);

Json vectorJson(const Vec3d& v);
Json boxJson(const Box& box);
/// "[0, 0, 0] to [1, 1, 2]"
std::string boxText(const Box& box);

}  // namespace nerfvdb
