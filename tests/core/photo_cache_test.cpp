// SPDX-License-Identifier: Apache-2.0
#include "core/photo_cache.h"

#include <optional>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

namespace {

Photo photoOf(int width, int height, int seed) {
    Photo photo;
    photo.width = width, photo.height = height;
    photo.has_alpha = seed % 2 == 1;
    for (int i = 0; i < width * height; ++i) {
        const int v = i * 31 + seed;
        photo.pixels.push_back({static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8),
                                static_cast<std::uint8_t>(seed), static_cast<std::uint8_t>(255 - v)});
    }
    return photo;
}

}  // namespace

TEST_CASE("cached photographs show the pixels that they had, after the cache is gone and its pages too") {
    const TempDir dir;
    const std::vector<Photo> photos = {photoOf(64, 40, 1), photoOf(1, 1, 2), photoOf(37, 101, 3), photoOf(8, 8, 4)};
    std::vector<Photo> cached;
    {
        PhotoCache cache(dir.path());
        for (const Photo& photo : photos) cached.push_back(cache.add(photo));
        CHECK(std::filesystem::is_empty(dir.path()));  // no name: nothing can be left behind
    }
    for (const bool again : {false, true}) {
        CAPTURE(again);
        for (std::size_t i = 0; i < photos.size(); ++i) {
            CHECK(cached[i].pixels.empty());
            CHECK(cached[i].width == photos[i].width);
            CHECK(cached[i].height == photos[i].height);
            CHECK(cached[i].has_alpha == photos[i].has_alpha);
            CHECK(cached[i].pixelCount() == photos[i].pixels.size());
            CHECK(rowsOf(cached[i]) == photos[i].pixels);
            CHECK(rowsOf(photos[i]) == photos[i].pixels);
            CHECK(cached[i].at(photos[i].width - 1, 0) == photos[i].at(photos[i].width - 1, 0));
            releasePages(cached[i]);
        }
    }
    const Photo copy = cached[2];
    cached.clear();
    CHECK(copy.at(36, 100) == photos[2].at(36, 100));
}

TEST_CASE("pages that are let go no longer count as memory") {
    const TempDir dir;
    const Photo photo = photoOf(2048, 2048, 1);  // 16 MiB
    PhotoCache cache(dir.path());
    const Photo cached = cache.add(photo);
    REQUIRE(rowsOf(cached) == photo.pixels);
    const std::size_t before = mappedFileBytes();
    releasePages(cached);
    CHECK(before - mappedFileBytes() >= std::size_t{15} << 20);
}

TEST_CASE("pixels that are looked at bring little more than themselves into memory") {
    const TempDir dir;
    PhotoCache cache(dir.path());
    const Photo cached = cache.add(photoOf(2048, 2048, 1));
    const std::size_t before = mappedFileBytes();
    int sum = 0;
    for (const int at : {300, 1000, 1700}) sum += cached.at(at, at)[0];
    REQUIRE(sum > 0);
    CHECK(mappedFileBytes() - before <= std::size_t{1} << 20);
}

TEST_CASE("a cache that finds no place says where and what to do") {
    const TempDir dir;
    CHECK_THROWS_AS(PhotoCache(dir / "none"), IoError);
    CHECK_THROWS_WITH(PhotoCache(dir / "none"), Catch::Contains("none") && Catch::Contains("--cache"));
    PhotoCache cache(dir.path());
    const Photo photo = photoOf(64, 64, 1);
    std::string message;
    {
        const SmallDisk full_disk(10000);
        try {
            cache.add(photo);
        } catch (const IoError& error) {
            message = error.what();
        }
    }
    CHECK_THAT(message, Catch::Contains("File too large") && Catch::Contains("--cache"));
}
