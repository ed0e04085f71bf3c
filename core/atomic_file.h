// SPDX-License-Identifier: Apache-2.0
// Files that are either the old version or the new one, never half of one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace nerfvdb {

/// Calls write(temporary_path), flushes the file to disk (fsync), then renames it to `path`.
/// The temporary lies beside `path` and has its extension, so that writers may go by the name.
/// On any failure (an exception, a full disk, a folder that cannot be written, `path` being a directory) the
/// temporary is removed, what stood at `path` is untouched, and IoError says what to do. An Error that `write`
/// throws passes through as it is, and so does std::bad_alloc.
void writeAtomically(const std::filesystem::path& path,
                     const std::function<void(const std::filesystem::path& temporary)>& write);

/// How far a file must have got before it takes its name. `system`: safe when this program dies, not when the
/// machine loses power; for large files that are soon replaced and carry their own checksum.
enum class Durable { disk, system };

/// The same for content that is already in memory.
void writeAtomically(const std::filesystem::path& path, std::string_view bytes, Durable durable = Durable::disk);

/// The same for content that comes in pieces: write(append), where append(bytes) adds them to the end; what it returns
/// then takes the place of as many bytes at the file's begin.
using AppendBytes = std::function<void(std::span<const std::byte>)>;
void writePieces(const std::filesystem::path& path, const std::function<std::string(const AppendBytes& append)>& write,
                 Durable durable);

/// Removes the temporaries of `path`, or of all files in that folder, that killed programs left behind, and none that a
/// living one is writing: that one holds a lock (flock). What cannot be removed stays, without a word.
void removeOrphans(const std::filesystem::path& path);

/// Whole file as bytes. Throws IoError.
std::string readFile(const std::filesystem::path& path);

/// 128-bit content hash (XXH3) as 32 lower-case hexadecimal digits.
std::string contentHash(std::span<const std::byte> bytes);

/// The same of bytes that come in pieces.
class ContentHash {
public:
    ContentHash();
    ~ContentHash();
    void add(std::span<const std::byte> bytes);
    /// Of all bytes so far.
    std::string digits() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nerfvdb
