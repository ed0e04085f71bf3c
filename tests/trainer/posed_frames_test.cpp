// SPDX-License-Identifier: Apache-2.0
#include "trainer/posed_frames.h"

#include <set>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Contains;

TEST_CASE("paths that lead out of a folder are none", "[trainer]") {
    for (const char* name : {"", "/etc/passwd", "..", "../a.png", "a/../../b.png", "./../a.png", "a/b/../../../c"})
        CHECK_FALSE(pathInside(name));
    CHECK_FALSE(pathInside(std::string("a\0b.png", 7)));
    CHECK(pathInside("./images/a.png").value() == "images/a.png");
    CHECK(pathInside("a/../b.png").value() == "b.png");
    CHECK(pathInside("..a..b.png"));
}

TEST_CASE("lists of other machines name what lies in the folder", "[trainer]") {
    const std::set<std::filesystem::path> there{"images/a.png", "b.png", "od\\d.png"};
    const auto placed = [&](const std::string& name) {
        const auto place = placeInside(name, [&](const std::filesystem::path& p) { return there.count(p) > 0; });
        return place ? place->string() : "none";
    };
    for (const char* name : {"images/a.png", "./images/a.png", ".\\images\\a.png", "C:\\Users\\me\\fox\\images\\a.png",
                             "D:/fox/images/a.png", "/home/me/fox/images/a.png", "../fox/images/a.png", "../images/a.png"})
        CHECK(placed(name) == "images/a.png");
    CHECK(placed("/home/me/b.png") == "b.png");
    CHECK(placed("od\\d.png") == "od\\d.png");  // a name that a file can have here
    // A relative path is meant as it stands: cam2/b.png is no b.png.
    for (const char* name : {"cam2/b.png", "cam2\\b.png", "/home/me/c.png", "..", "", "/", "C:\\"}) CHECK(placed(name) == "none");
}

TEST_CASE("the folder of images is the largest version that is there", "[trainer]") {
    const TempDir dir;
    CHECK_THROWS_WITH(findImageFolder(dir.path()), Contains("'images_8'"));
    for (const char* name : {"images_8", "images_4", "images_2", "images"}) {
        std::filesystem::create_directory(dir / name);
        CHECK(findImageFolder(dir.path()) == dir / name);
    }
}

TEST_CASE("names of images, sizes of one aspect", "[trainer]") {
    for (const char* name : {"a.png", "a.JPG", "b/c.jpeg", "d.Exr"}) CHECK(isImageName(name));
    for (const char* name : {"a.txt", "png", ".png", "a.png.bak"}) CHECK_FALSE(isImageName(name));
    CHECK(isSameAspect(41, 20, 20, 10));
    CHECK(isSameAspect(4032, 3024, 504, 378));
    CHECK(isSameAspect(40, 20, 20, 11));
    CHECK_FALSE(isSameAspect(40, 20, 20, 12));
    CHECK_FALSE(isSameAspect(4032, 3024, 378, 504));
    CHECK(isSameAspect(20, 10, 41, 20));  // enlarged
    CHECK_THAT(adviceOnAspect(4032, 3024, 378, 504), Contains("lies on its side"));
    CHECK_THAT(adviceOnAspect(40, 20, 20, 12), Contains("that were posed"));
}
