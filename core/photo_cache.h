// SPDX-License-Identifier: Apache-2.0
// Photographs that are too many for memory: decoded once into tiles on disk and read from there as if they were in
// memory. The file has no name, so that nothing is left of it however the program ends.
#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>

#include "core/image.h"

namespace nerfvdb {

/// Takes photographs in from many threads. What it hands out outlives it.
class PhotoCache {
public:
    /// Makes the file in an existing folder. Throws IoError.
    explicit PhotoCache(const std::filesystem::path& folder);
    ~PhotoCache();
    PhotoCache(const PhotoCache&) = delete;
    PhotoCache& operator=(const PhotoCache&) = delete;

    /// The same photograph, its pixels in the file. Throws IoError, such as for a full disk.
    Photo add(const Photo& photo);

private:
    std::filesystem::path folder_;
    int file_ = -1;
    std::atomic<std::size_t> end_{0};  // bytes given out
};

/// The pixels of a photograph, rows from the top, wherever it keeps them.
std::vector<Photo::Pixel> rowsOf(const Photo& photo);

/// Lets go of the memory through which a photograph on disk was read; what is read again comes back by itself.
void releasePages(const Photo& photo);

/// Bytes of files that this process now holds mapped in memory: cached photographs and the program itself.
std::size_t mappedFileBytes();

}  // namespace nerfvdb
