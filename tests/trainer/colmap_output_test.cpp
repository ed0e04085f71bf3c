// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_output.h"

#include <cstring>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
namespace fs = std::filesystem;
using Kind = ColmapLine::Kind;

namespace {

void checkLine(const char* text, Kind kind, std::int64_t done, std::int64_t total) {
    INFO(text);
    const std::optional<ColmapLine> line = parseColmapLine(text);
    REQUIRE(line);
    CHECK(line->kind == kind);
    CHECK(line->done == done);
    CHECK(line->total == total);
}

template <typename T>
std::string bytesOf(T value) {
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

void writeModel(const fs::path& folder, const std::vector<std::string>& names, std::uint64_t points) {
    fs::create_directories(folder);
    writeAtomically(folder / "cameras.bin", "");
    writeAtomically(folder / "points3D.bin", bytesOf(points));
    std::string bytes = bytesOf(std::uint64_t{names.size()});
    for (std::uint32_t i = 0; i < names.size(); ++i) {
        bytes += bytesOf(i + 1);
        for (int k = 0; k < 7; ++k) bytes += bytesOf(0.5 * k);
        bytes += bytesOf(std::uint32_t{1}) + names[i] + '\0' + bytesOf(std::uint64_t{i});
        bytes += std::string(24 * i, 'p');
    }
    writeAtomically(folder / "images.bin", bytes);
}

}  // namespace

TEST_CASE("COLMAP's lines tell how far it is", "[trainer]") {
    checkLine("Processed file [7/50]", Kind::file_done, 7, 50);
    checkLine("  Features:        1439", Kind::features, 1439, 0);
    checkLine("Matching block [1/3, 2/3] in 1.024s", Kind::block_done, 2, 9);
    checkLine("Matching block [3/3, 3/3] in 0.326s", Kind::block_done, 9, 9);
    checkLine("Matching image [12/300] in 0.1s", Kind::image_matched, 12, 300);
    checkLine("Initializing with image pair #4 and #9", Kind::model_begun, 2, 0);
    checkLine("Registering image #5 (3)", Kind::image_registered, 3, 0);

    // 3.13: a logger's prefix, and the number of photographs before this one.
    checkLine("I20250619 20:05:59.566437 14324 feature_extraction.cc:258] Processed file [1/24]", Kind::file_done, 1, 24);
    checkLine("I2025 1 a.cc:5] Processing block [2/2, 1/2]", Kind::block_done, 3, 4);
    checkLine("I2025 1 a.cc:5] Processing image [3/4]", Kind::image_matched, 3, 4);
    checkLine("I2025 1 a.cc:5] Registering image #7 (num_reg_frames=2)", Kind::image_registered, 3, 0);

    for (const char* other : {"", "Elapsed time: 0.111 [minutes]", "Processed file [x/2]", "Processed file [1", "Features: many",
                              "Matching block [1/3]", "Registering image #5", "  => Image sees 12 / 40 points"}) {
        INFO(other);
        CHECK(!parseColmapLine(other));
    }
}

TEST_CASE("options are listed by their full names", "[trainer]") {
    CHECK(colmapOptions({"COLMAP 3.8", "  -h [ --help ] ", "  --random_seed arg (=0)", "  --SiftMatching.use_gpu arg (=1)",
                         "                   --no option", "  --database_path arg"}) ==
          std::vector<std::string>{"random_seed", "SiftMatching.use_gpu", "no", "database_path"});
}

TEST_CASE("models are listed with their photographs, the largest first", "[trainer]") {
    const TempDir dir;
    writeModel(dir / "0", {"b.jpg", "a.jpg"}, 900);
    writeModel(dir / "1", {"sub folder/z.png", "y.png", "x.png"}, 5);
    writeModel(dir / "2", {"d.jpg", "e.jpg"}, 901);
    fs::create_directory(dir / "3");  // begun, not finished
    writeAtomically(dir / "readme.txt", "no model");

    const std::vector<ColmapModel> models = listColmapModels(dir.path());
    REQUIRE(models.size() == 3);
    CHECK(models[0].folder == dir / "1");
    CHECK(models[0].registered == std::vector<std::string>{"sub folder/z.png", "x.png", "y.png"});
    CHECK(models[0].points == 5);
    CHECK(models[1].folder == dir / "2");  // as many photographs, more points
    CHECK(models[2].registered == std::vector<std::string>{"a.jpg", "b.jpg"});
    CHECK(listColmapModels(dir / "absent").empty());
}

TEST_CASE("a model cut short anywhere is an error", "[trainer]") {
    const TempDir dir;
    writeModel(dir / "0", {"a.jpg", "b.jpg", "c.jpg"}, 5);
    const std::string whole = readFile(dir / "0" / "images.bin");
    for (std::size_t size = 0; size < whole.size(); ++size) {
        INFO(size);
        writeAtomically(dir / "0" / "images.bin", whole.substr(0, size));
        CHECK_THROWS_WITH(listColmapModels(dir.path()), Catch::Contains("images.bin: found a file cut short at byte " +
                                                                        std::to_string(size)));
    }
    std::string endless = whole;  // a number of points that no file holds
    std::memset(endless.data() + 8 + 4 + 56 + 4 + 6, 0xff, 8);
    writeAtomically(dir / "0" / "images.bin", endless);
    CHECK_THROWS_AS(listColmapModels(dir.path()), DataError);
}
