// SPDX-License-Identifier: Apache-2.0
// Places to write to, checked before hours of work and not after.
#pragma once

#include <filesystem>
#include <string>

namespace nerfvdb {

/// Makes the folder of `file` if it is missing and proves that a file can be written there.
/// Throws IoError naming `where` (the option): not a folder, no permission, `file` is itself a folder.
/// What killed runs left of it half written is removed.
void prepareOutputFile(const std::string& where, const std::filesystem::path& file);

/// The same for a folder of many files.
void prepareOutputFolder(const std::string& where, const std::filesystem::path& folder);

}  // namespace nerfvdb
