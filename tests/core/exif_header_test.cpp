// SPDX-License-Identifier: Apache-2.0
#include "core/exif_header.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/image.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

namespace {

constexpr int kMake = 0x010F, kPrivate = 0x8769, kPosition = 0x8825, kMakerNote = 0x927C;

struct Entry {
    int tag;
    std::uint32_t value;
};

std::string number(std::uint32_t value, int count, bool is_big_endian) {
    std::string bytes;
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> 8 * (is_big_endian ? count - 1 - i : i) & 0xff);
    return bytes;
}

/// A TIFF block of directories at the given places, the first of them the first directory.
std::string tiff(const std::vector<std::pair<std::size_t, std::vector<Entry>>>& directories, bool is_big_endian = false) {
    std::string block = (is_big_endian ? "MM" : "II") + number(42, 2, is_big_endian) +
                        number(static_cast<std::uint32_t>(directories.front().first), 4, is_big_endian);
    for (const auto& [begin, entries] : directories) {
        std::string bytes = number(static_cast<std::uint32_t>(entries.size()), 2, is_big_endian);
        for (const Entry& entry : entries)
            bytes += number(static_cast<std::uint32_t>(entry.tag), 2, is_big_endian) + number(4, 2, is_big_endian) +
                     number(1, 4, is_big_endian) + number(entry.value, 4, is_big_endian);
        block.resize(std::max(block.size(), begin + bytes.size()));
        block.replace(begin, bytes.size(), bytes);
    }
    return block;
}

std::string jpeg(const std::string& block) {
    const std::string segment = std::string("Exif\0\0", 6) + block;
    return "\xFF\xD8\xFF\xE0" + number(4, 2, true) + "ab" + "\xFF\xE1" +
           number(static_cast<std::uint32_t>(segment.size() + 2), 2, true) + segment + "\xFF\xDA" + number(2, 2, true);
}

std::string png(const std::string& block) {
    return "\x89PNG\r\n\x1a\n" + number(static_cast<std::uint32_t>(block.size()), 4, true) + "eXIf" + block + "sums" +
           number(0, 4, true) + "IEND" + "sums";
}

std::string problemOf(const std::string& bytes) {
    std::istringstream file(bytes);
    return exifProblem(file);
}

bool isRefused(const std::string& block) {
    const bool in_jpeg = !problemOf(jpeg(block)).empty(), in_png = !problemOf(png(block)).empty();
    CHECK(in_jpeg == in_png);
    return in_jpeg;
}

}  // namespace

TEST_CASE("EXIF as cameras write it is sound, and so is none") {
    for (const bool is_big_endian : {false, true}) {
        CAPTURE(is_big_endian);
        CHECK(!isRefused(tiff({{8, {{kMake, 1}, {kPrivate, 50}, {kPosition, 100}}}, {50, {{kMakerNote, 150}}}, {100, {{1, 2}}},
                               {150, {{1, 2}, {6, 8}}}},
                              is_big_endian)));
        // Some programs write the first directory last.
        CHECK(!isRefused(tiff({{100, {{kPrivate, 8}}}, {8, {{kMake, 1}}}}, is_big_endian)));
    }
    CHECK(problemOf("").empty());
    CHECK(problemOf("no picture").empty());
    CHECK(problemOf("\xFF\xD8\xFF").empty());
    CHECK(problemOf(jpeg("")).empty());
    CHECK(problemOf(jpeg("XX*")).empty());
}

TEST_CASE("EXIF that is cut anywhere, or points behind its end, is sound: nothing is followed there") {
    const std::string whole = tiff({{8, {{kPrivate, 30}}}, {30, {{kMakerNote, 4000000000u}}}});
    for (std::size_t size = 0; size <= whole.size(); ++size) CHECK(!isRefused(whole.substr(0, size)));
    const std::string file = jpeg(whole);
    for (std::size_t size = 0; size <= file.size(); ++size) CHECK(problemOf(file.substr(0, size)).empty());
}

TEST_CASE("EXIF directories that lead back to themselves are refused") {
    for (const bool is_big_endian : {false, true}) {
        CAPTURE(is_big_endian);
        CHECK(isRefused(tiff({{8, {{kPrivate, 8}}}}, is_big_endian)));
        // What OpenImageIO follows until the stack ends: a maker note that is the first directory.
        CHECK(isRefused(tiff({{8, {{kMake, 1}, {kPrivate, 50}}}, {50, {{kMakerNote, 8}}}}, is_big_endian)));
        CHECK(isRefused(tiff({{8, {{kPosition, 50}}}, {50, {{kPosition, 8}}}}, is_big_endian)));
    }
    // A note so short that its place is taken as it stands, in whatever order.
    CHECK(isRefused(tiff({{8, {{kPrivate, 50}}}, {50, {{kMakerNote, 8u << 24}}}}, true)));
}

TEST_CASE("EXIF directories in a long chain, or fanned out, are refused in no time") {
    std::vector<std::pair<std::size_t, std::vector<Entry>>> chain, fan;
    for (std::uint32_t i = 0; i < 20; ++i) chain.push_back({8 + 20 * i, {{kPrivate, 8 + 20 * (i + 1)}}});
    CHECK(isRefused(tiff(chain)));
    for (std::uint32_t i = 0; i < 6; ++i)
        fan.push_back({8 + 1000 * i, std::vector<Entry>(60, {kPosition, 8 + 1000 * (i + 1)})});  // 60^6 ways
    CHECK(isRefused(tiff(fan)));
}

TEST_CASE("a photograph with EXIF that has no end is refused by name, whatever is asked of it") {
    const TempDir dir;
    const std::string sound = [&] {
        writeImage(dir / "sound.jpg", Image(8, 8, 3));
        return readFile(dir / "sound.jpg");
    }();
    const std::string block = tiff({{8, {{kMake, 1}, {kPrivate, 50}}}, {50, {{kMakerNote, 8}}}});
    const std::string whole = jpeg(block);
    writeAtomically(dir / "circle.jpg", whole.substr(0, whole.size() - 4) + sound.substr(2));
    CHECK_THROWS_WITH(readPhotoOrigin(dir / "circle.jpg"), Catch::Contains("circle.jpg") && Catch::Contains("EXIF"));
    CHECK_THROWS_AS(readPhoto(dir / "circle.jpg"), DataError);
    CHECK_THROWS_AS(readImageHeader(dir / "circle.jpg"), DataError);
}
