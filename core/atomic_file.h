// SPDX-License-Identifier: Apache-2.0
// Files that are either the old version or the new one, never half of one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

namespace nerfvdb {

/// Calls write(temporary_path), flushes the file to disk (fsync), then renames it to `path`.
/// On any failure (an exception, a full disk, a folder that cannot be written, `path` being a directory) the
/// temporary is removed, what stood at `path` is untouched, and IoError says what to do.
void writeAtomically(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& temporary)>& write);

/// Whole file as bytes. Throws IoError.
std::string readFile(const std::filesystem::path& path);

/// 128-bit content hash (XXH3) as 32 lower-case hexadecimal digits.
std::string contentHash(std::span<const std::byte> bytes);

}  // namespace nerfvdb
