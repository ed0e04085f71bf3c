// SPDX-License-Identifier: Apache-2.0
#include "core/png_chunks.h"

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

const std::string kSignature = "\x89PNG\r\n\x1a\n";

std::string chunk(const std::string& type, const std::string& data, std::uint32_t length) {
    std::string bytes;
    for (int i = 3; i >= 0; --i) bytes += static_cast<char>(length >> 8 * i & 0xff);
    return bytes + type + data + "sums";
}

std::string chunk(const std::string& type, const std::string& data) {
    return chunk(type, data, static_cast<std::uint32_t>(data.size()));
}

std::string header(bool is_interlaced) { return chunk("IHDR", std::string(12, '\1') + static_cast<char>(is_interlaced)); }

std::string problemOf(const std::string& bytes) {
    std::istringstream file(bytes);
    return pngChunkProblem(file);
}

}  // namespace

TEST_CASE("chunks are walked through as they stand, up to where the file ends") {
    std::istringstream file(kSignature + header(false) + chunk("tEXt", "by hand") + chunk("IEND", "") + "more");
    PngChunks chunks(file);
    std::vector<std::string> types;
    while (chunks.next()) {
        types.push_back(chunks.type());
        if (chunks.type() == "tEXt") {
            CHECK(chunks.length() == 7);
            CHECK(chunks.data() == "by hand");
            CHECK(chunks.left() == 7 + 4 + 12 + 4);
        }
    }
    CHECK(types == std::vector<std::string>{"IHDR", "tEXt", "IEND"});
}

TEST_CASE("a chunk that is longer than the file is refused, and one of pixels is left to who counts those") {
    constexpr std::uint32_t kTwoGigabytes = 0x7fffffff;
    const std::string end = chunk("IEND", "");
    CHECK(problemOf("").empty());
    CHECK(problemOf("no picture").empty());
    CHECK(problemOf(kSignature).empty());
    for (const bool is_interlaced : {false, true}) {
        const std::string begin = kSignature + header(is_interlaced), text = chunk("tEXt", "by hand");
        CAPTURE(is_interlaced);
        CHECK(problemOf(begin + text + chunk("IDAT", "pixels") + text + end).empty());
        CHECK(problemOf(begin + chunk("IDAT", "pixels") + end + "what some cameras append, such as a film").empty());
        CHECK(problemOf(begin + chunk("IDAT", "pixels", kTwoGigabytes)).empty());
        CHECK(problemOf(begin + chunk("tEXt", "by hand", kTwoGigabytes)) ==
              "a chunk of 2147483647 bytes where the file has 11 left");
        CHECK(!problemOf(begin + chunk("zTXt", "", 5)).empty());
        CHECK(problemOf(begin + chunk("zTXt", "", 4)).empty());  // its check is missing, but nothing is too long
        // After the pixels decoders read on only to bring interlaced ones to their end.
        CHECK(problemOf(begin + chunk("IDAT", "pixels") + chunk("iTXt", "", kTwoGigabytes)).empty() == !is_interlaced);
    }
}

TEST_CASE("a picture with a chunk beyond its end is refused by name, whatever is asked of it") {
    const TempDir dir;
    writeImage(dir / "sound.png", Image(8, 8, 3));
    const std::string sound = readFile(dir / "sound.png");
    const std::size_t after_header = kSignature.size() + 25;
    writeAtomically(dir / "long.png", sound.substr(0, after_header) + chunk("tEXt", "a", 0x7a1900c8) + sound.substr(after_header));
    CHECK_THROWS_WITH(readImageHeader(dir / "long.png"), Catch::Contains("long.png") && Catch::Contains("2048458952 bytes"));
    CHECK_THROWS_AS(readPhoto(dir / "long.png"), DataError);
    CHECK_THROWS_AS(readImage(dir / "long.png"), DataError);
}
