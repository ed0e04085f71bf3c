// SPDX-License-Identifier: Apache-2.0
// A folder of photographs as it comes from a camera: which files count, and where they go in a data set.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/report.h"

namespace nerfvdb {

/// Names of the photographs (.jpg, .jpeg, .png) below a folder, relative to it with '/', sorted; hidden files and
/// folders do not count. Others are told as a warning.
/// Throws IoError / DataError: no such folder, a video (with the command that cuts it into frames), fewer than three
/// photographs.
std::vector<std::string> listPhotos(const std::filesystem::path& folder, Report& report);

/// Puts photographs into `target` under their own names: hard links, which take no room and outlast the originals'
/// names; copies where links cannot be (another disk). Photographs that are there already, unchanged, stay.
/// Nothing happens when `target` is `folder` itself. Throws IoError, or Interrupted when the report asks to stop.
void placePhotos(const std::filesystem::path& folder, const std::vector<std::string>& names,
                 const std::filesystem::path& target, Report& report);

}  // namespace nerfvdb
