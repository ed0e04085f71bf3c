// SPDX-License-Identifier: Apache-2.0
#include "trainer/photo_folder.h"

#include <chrono>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

struct Listener : Report {
    void warn(const std::string& line) override { warnings.push_back(line); }
    std::vector<std::string> warnings;
};

void put(const fs::path& path, const std::string& text = "picture") {
    fs::create_directories(path.parent_path());
    writeAtomically(path, text);
}

}  // namespace

TEST_CASE("photographs of a folder are listed with those of its sub-folders", "[trainer]") {
    const TempDir dir;
    Listener report;
    for (const char* name : {"b.JPG", "a.png", "sub/c.jpeg", ".hidden.jpg", ".thumbs/d.jpg"}) put(dir / name);
    CHECK(listPhotos(dir.path(), report) == std::vector<std::string>{"a.png", "b.JPG", "sub/c.jpeg"});
    CHECK(report.warnings.empty());

    put(dir / "raw.heic");
    put(dir / "walk.mp4");
    CHECK(listPhotos(dir.path(), report).size() == 3);
    REQUIRE(report.warnings.size() == 1);
    CHECK_THAT(report.warnings[0], Contains("2 files are no photographs") && Contains("raw.heic, ..."));
}

TEST_CASE("what is no folder of photographs is refused with advice", "[trainer]") {
    const TempDir dir;
    Report report;
    CHECK_THROWS_WITH(listPhotos(dir / "absent", report), Contains("absent: found no such file or folder"));
    put(dir / "notes.txt");
    CHECK_THROWS_WITH(listPhotos(dir / "notes.txt", report), Contains("a folder of photographs"));
    put(dir / "few" / "a.jpg");
    put(dir / "few" / "b.jpg");
    put(dir / "few" / "c.heic");
    CHECK_THROWS_WITH(listPhotos(dir / "few", report), Contains("found 2 photographs (.jpg, .png) beside c.heic"));
    put(dir / "film" / "my walk's.MOV");
    for (const fs::path& video : {dir / "film", dir / "film" / "my walk's.MOV"})
        CHECK_THROWS_WITH(listPhotos(video, report),
                          Contains("found a video") && Contains("ffmpeg -i '") && Contains("my walk'\\''s.MOV' -vf fps=2"));
}

TEST_CASE("photographs are laid into a data set as links, and stay there", "[trainer]") {
    const TempDir dir;
    Report report;
    put(dir / "in" / "a.jpg", "first");
    put(dir / "in" / "sub" / "b.jpg", "second");
    fs::create_symlink(dir / "in" / "a.jpg", dir / "in" / "c.jpg");
    const std::vector<std::string> names{"a.jpg", "c.jpg", "sub/b.jpg"};
    const fs::path out = dir / "out" / "images";
    placePhotos(dir / "in", names, out, report);
    CHECK(fs::equivalent(out / "a.jpg", dir / "in" / "a.jpg"));
    CHECK(!fs::is_symlink(out / "c.jpg"));

    fs::remove_all(dir / "in");
    CHECK(readFile(out / "a.jpg") == "first");
    CHECK(readFile(out / "c.jpg") == "first");
    CHECK(readFile(out / "sub" / "b.jpg") == "second");

    // A photograph that changed since is laid anew; what is already in its place is left alone.
    put(dir / "in" / "a.jpg", "another");
    placePhotos(dir / "in", {"a.jpg"}, out, report);
    CHECK(readFile(out / "a.jpg") == "another");
    placePhotos(out, {"a.jpg"}, out, report);
    CHECK(readFile(out / "a.jpg") == "another");
}
