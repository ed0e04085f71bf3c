// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <unistd.h>

#include <fstream>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

std::size_t filesIn(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("an atomic write replaces the file and leaves nothing else", "[core]") {
    const TempDir dir;
    const fs::path path = dir / "model.vdb";
    writeAtomically(path, "first");
    CHECK(readFile(path) == "first");

    writeAtomically(path, [&](const fs::path& temporary) {
        CHECK(temporary.extension() == ".vdb");
        CHECK(temporary.parent_path() == dir.path());
        CHECK(readFile(path) == "first");  // still the old one
        std::ofstream(temporary, std::ios::binary) << std::string("second\0part", 11);
    });
    CHECK(readFile(path) == std::string("second\0part", 11));
    CHECK(filesIn(dir.path()) == 1);
}

TEST_CASE("a relative path without a folder is written beside the program's folder", "[core]") {
    const TempDir dir;
    const fs::path before = fs::current_path();
    fs::current_path(dir.path());
    writeAtomically("plain.txt", "x");
    fs::current_path(before);
    CHECK(readFile(dir / "plain.txt") == "x");
}

TEST_CASE("a symbolic link keeps pointing at the file that is replaced", "[core]") {
    const TempDir dir;
    writeAtomically(dir / "real.txt", "old");
    fs::create_symlink("real.txt", dir / "link.txt");
    writeAtomically(dir / "link.txt", "new");
    CHECK(fs::is_symlink(dir / "link.txt"));
    CHECK(readFile(dir / "real.txt") == "new");
}

TEST_CASE("a failed write leaves the old file and no temporary", "[core]") {
    const TempDir dir;
    const fs::path path = dir / "a.txt";
    writeAtomically(path, "old");

    SECTION("the writer throws our own error: it passes unchanged") {
        CHECK_THROWS_WITH(writeAtomically(path, [](const fs::path&) { throw DataError("mesh: no faces"); }),
                          "mesh: no faces");
    }
    SECTION("the writer throws something else: the path is named") {
        CHECK_THROWS_AS(writeAtomically(path, [](const fs::path&) { throw std::runtime_error("boom"); }),
                        IoError);
        CHECK_THROWS_WITH(writeAtomically(path, [](const fs::path&) { throw std::runtime_error("boom"); }),
                          Contains("a.txt") && Contains("boom"));
    }
    SECTION("the writer removes the temporary") {
        CHECK_THROWS_AS(writeAtomically(path, [](const fs::path& temporary) { fs::remove(temporary); }),
                        IoError);
    }
    SECTION("the disk is full") {
        const SmallDisk disk(1000);
        CHECK_THROWS_AS(writeAtomically(path, std::string(5000, 'x')), IoError);
    }
    CHECK(readFile(path) == "old");
    CHECK(filesIn(dir.path()) == 1);
}

TEST_CASE("targets that cannot be written are named with advice", "[core]") {
    const TempDir dir;
    fs::create_directory(dir / "folder");
    writeAtomically(dir / "file", "x");
    CHECK_THROWS_WITH(writeAtomically(dir / "folder", "x"), Contains("folder") && Contains("name of a file"));
    CHECK_THROWS_WITH(writeAtomically(dir / "absent" / "x.txt", "x"),
                      Contains("no folder") && Contains("create it"));
    CHECK_THROWS_WITH(writeAtomically(dir / "file" / "x.txt", "x"), Contains("is a file"));
    CHECK_THROWS_WITH(writeAtomically("/dev/null", "x"), Contains("device"));
    CHECK_THROWS_AS(writeAtomically("", "x"), IoError);
    if (geteuid() != 0) {  // root may write everywhere
        fs::permissions(dir / "folder", fs::perms::owner_read | fs::perms::owner_exec);
        CHECK_THROWS_WITH(writeAtomically(dir / "folder" / "x", "x"), Contains("Permission denied"));
        fs::permissions(dir / "folder", fs::perms::owner_all);
    }
}

TEST_CASE("reading names what is not a file", "[core]") {
    const TempDir dir;
    CHECK_THROWS_WITH(readFile(dir / "none"), Contains("none") && Contains("No such file"));
    CHECK_THROWS_WITH(readFile(dir.path()), Contains("found a folder"));
    writeAtomically(dir / "empty", "");
    CHECK(readFile(dir / "empty").empty());
}

TEST_CASE("the content hash is XXH3-128 as xxh128sum prints it", "[core]") {
    CHECK(contentHash({}) == "99aa06d3014798d86001c324468d497f");  // the published value for no input
    const std::string abc = "abc", abd = "abd";
    CHECK(contentHash(std::as_bytes(std::span(abc))) == "06b05ab6733a618578af5f94892f3950");
    CHECK(contentHash(std::as_bytes(std::span(abc))) != contentHash(std::as_bytes(std::span(abd))));
}
