// SPDX-License-Identifier: Apache-2.0
#include "core/photo_cache.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

#include "core/error.h"

namespace nerfvdb {
namespace {

// Linux caches what is written at once in as large a block as it can, and maps all of a block when a byte of it is read.
constexpr std::size_t kPieceBytes = std::size_t{64} << 10;
constexpr std::size_t kTilePixels = static_cast<std::size_t>(Photo::kTile) * Photo::kTile;

std::size_t tileCount(const Photo& photo) {
    const auto along = [](int pixels) { return static_cast<std::size_t>((pixels + Photo::kTile - 1) / Photo::kTile); };
    return along(photo.width) * along(photo.height);
}

std::size_t bytesOnDisk(const Photo& photo) {
    const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    return (tileCount(photo) * kTilePixels * sizeof(Photo::Pixel) + page - 1) / page * page;
}

[[noreturn]] void throwErrno(const std::filesystem::path& folder, const std::string& expected) {
    throw IoError(folder.string() + ": cache of photographs", std::strerror(errno), expected,
                  "name another folder with --cache, or allow a larger --max-memory");
}

}  // namespace

PhotoCache::PhotoCache(const std::filesystem::path& folder) : folder_(folder.empty() ? "." : folder) {
    std::string name = (folder_ / "nerfvdb-photographs-XXXXXX").string();
    file_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (file_ < 0) throwErrno(folder_, "a folder that can be written");
    ::unlink(name.c_str());
}

PhotoCache::~PhotoCache() { ::close(file_); }

Photo PhotoCache::add(const Photo& photo) {
    Photo cached;
    cached.width = photo.width;
    cached.height = photo.height;
    cached.has_alpha = photo.has_alpha;

    std::vector<Photo::Pixel> tiles(tileCount(photo) * kTilePixels);
    for (int y = 0; y < photo.height; ++y)
        for (int x = 0; x < photo.width; ++x) tiles[photo.tiledIndex(x, y)] = photo.at(x, y);
    const std::size_t bytes = bytesOnDisk(photo), begin = end_.fetch_add(bytes);
    const char* const data = reinterpret_cast<const char*>(tiles.data());
    const std::size_t used = tiles.size() * sizeof tiles[0];
    for (std::size_t done = 0; done < used;) {
        const std::size_t piece = std::min(used - done, kPieceBytes);
        const ssize_t written = ::pwrite(file_, data + done, piece, static_cast<off_t>(begin + done));
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) throwErrno(folder_, "room for the decoded photographs");
        done += static_cast<std::size_t>(written);
    }

    void* const map = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file_, static_cast<off_t>(begin));
    if (map == MAP_FAILED) throwErrno(folder_, "a file that can be mapped");
    ::madvise(map, bytes, MADV_RANDOM);  // advice: a refusal costs speed only
    cached.tiles = std::shared_ptr<const Photo::Pixel>(static_cast<const Photo::Pixel*>(map), [bytes](const Photo::Pixel* p) {
        ::munmap(const_cast<Photo::Pixel*>(p), bytes);
    });
    return cached;
}

std::vector<Photo::Pixel> rowsOf(const Photo& photo) {
    if (!photo.tiles) return photo.pixels;
    std::vector<Photo::Pixel> rows;
    rows.reserve(photo.pixelCount());
    for (int y = 0; y < photo.height; ++y)
        for (int x = 0; x < photo.width; ++x) rows.push_back(photo.at(x, y));
    return rows;
}

void releasePages(const Photo& photo) {
    if (photo.tiles) ::madvise(const_cast<Photo::Pixel*>(photo.tiles.get()), bytesOnDisk(photo), MADV_DONTNEED);
}

std::size_t mappedFileBytes() {
    std::ifstream file("/proc/self/statm");  // proc(5): size, resident, shared, ... in pages
    std::size_t size = 0, resident = 0, shared = 0;
    file >> size >> resident >> shared;
    return file ? shared * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) : 0;
}

}  // namespace nerfvdb
