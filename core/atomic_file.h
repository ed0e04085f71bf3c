// SPDX-License-Identifier: Apache-2.0
// Files that are either the old version or the new one, never half of one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace nerfvdb {

/// Calls write(temporary_path), flushes the file to disk (fsync), then renames it to `path`.
/// The temporary lies beside `path` and has its extension, so that writers may go by the name.
/// On any failure (an exception, a full disk, a folder that cannot be written, `path` being a directory) the
/// temporary is removed, what stood at `path` is untouched, and IoError says what to do. An Error that `write`
/// throws passes through as it is.
void writeAtomically(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& temporary)>& write);

/// How far a file must have got before it takes its name. `system`: safe when this program dies, not when the
/// machine loses power; for large files that are soon replaced and carry their own checksum.
enum class Durable { disk, system };

/// The same for content that is already in memory.
void writeAtomically(const std::filesystem::path& path, std::string_view bytes, Durable durable = Durable::disk);

/// Whole file as bytes. Throws IoError.
std::string readFile(const std::filesystem::path& path);

/// 128-bit content hash (XXH3) as 32 lower-case hexadecimal digits.
std::string contentHash(std::span<const std::byte> bytes);

}  // namespace nerfvdb
