// SPDX-License-Identifier: Apache-2.0
#include "core/atomic_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <new>

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

TEST_CASE("a file in pieces gets its head last") {
    const TempDir dir;
    const auto bytes = [](std::string_view text) { return std::as_bytes(std::span(text)); };
    writePieces(
        dir / "a.txt",
        [&](const AppendBytes& append) {
            append(bytes("----"));
            append(bytes("first"));
            append(bytes(" second"));
            return std::string("head");
        },
        Durable::system);
    CHECK(readFile(dir / "a.txt") == "headfirst second");
    CHECK_THROWS_AS(writePieces(dir / "a.txt", [&](const AppendBytes&) -> std::string { throw std::bad_alloc(); },
                                Durable::system),
                    std::bad_alloc);
    CHECK(readFile(dir / "a.txt") == "headfirst second");
    CHECK(filesIn(dir.path()) == 1);
}

TEST_CASE("what a killed program left is removed, and nothing that is being written or is another's") {
    const TempDir dir;
    const auto make = [&](const char* name) { std::ofstream(dir / name) << "half"; };
    const auto stands = [&](const char* name) { return fs::exists(dir / name); };
    const char* const kOthers[] = {"a.12-0.part.png", "b.12-0.part.vdb", "a.12.part.vdb", "a.part.vdb", "a.x-0.part.vdb",
                                   "a.vdb"};
    for (const char* name : kOthers) make(name);
    make("a.12-0.part.vdb");
    make("a.4000000-123.part.vdb");
    fs::create_directory(dir / "a.13-0.part.vdb");
    writeAtomically(dir / "a.vdb", [&](const fs::path& temporary) {
        removeOrphans(dir / "a.vdb");
        CHECK(fs::exists(temporary));
        removeOrphans(dir.path());
        CHECK(fs::exists(temporary));
        make("a.12-0.part.vdb");
        make("b.12-0.part.vdb");
        make("a.12-0.part.png");
        std::ofstream(temporary, std::ios::binary) << "whole";
    });
    CHECK(readFile(dir / "a.vdb") == "whole");
    removeOrphans(dir / "a.vdb");
    CHECK_FALSE(stands("a.12-0.part.vdb"));
    CHECK_FALSE(stands("a.4000000-123.part.vdb"));
    CHECK(stands("a.13-0.part.vdb"));
    for (const char* name : kOthers) CHECK(stands(name));

    removeOrphans(dir.path());
    CHECK_FALSE(stands("b.12-0.part.vdb"));
    CHECK_FALSE(stands("a.12-0.part.png"));
    for (const char* name : {"a.12.part.vdb", "a.part.vdb", "a.x-0.part.vdb", "a.vdb"}) CHECK(stands(name));
    removeOrphans(dir / "absent" / "a.vdb");
}

TEST_CASE("an orphan that has the next temporary's name is no obstacle") {
    const TempDir dir;
    std::string name;
    writeAtomically(dir / "a.txt", [&](const fs::path& temporary) { name = temporary.filename().string(); });
    const std::size_t dash = name.find('-'), dot = name.find('.', dash);
    const int next = std::stoi(name.substr(dash + 1)) + 1;
    std::ofstream(dir / (name.substr(0, dash + 1) + std::to_string(next) + name.substr(dot))) << "half";
    writeAtomically(dir / "a.txt", "whole");
    CHECK(readFile(dir / "a.txt") == "whole");
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
    // Nobody will ever write to this pipe: to wait for it, or for the end of /dev/zero, would be for ever.
    REQUIRE(::mkfifo((dir / "pipe").c_str(), 0600) == 0);
    CHECK_THROWS_WITH(readFile(dir / "pipe"), Contains("pipe: found a pipe or a device, expected a plain file"));
    CHECK_THROWS_WITH(readFile("/dev/zero"), Contains("found a pipe or a device"));
}

TEST_CASE("the hash of pieces is that of the whole") {
    std::string text;
    for (unsigned i = 0; i < 100000; ++i) text += static_cast<char>(i * i >> 3);
    const auto bytes = std::as_bytes(std::span(text));
    ContentHash hash;
    CHECK(hash.digits() == contentHash({}));
    for (std::size_t begin = 0, n = 1; begin < bytes.size(); begin += n, n = 3 * n)
        hash.add(bytes.subspan(begin, std::min(n, bytes.size() - begin)));
    CHECK(hash.digits() == contentHash(bytes));
}

TEST_CASE("the content hash is XXH3-128 as xxh128sum prints it", "[core]") {
    CHECK(contentHash({}) == "99aa06d3014798d86001c324468d497f");  // the published value for no input
    const std::string abc = "abc", abd = "abd";
    CHECK(contentHash(std::as_bytes(std::span(abc))) == "06b05ab6733a618578af5f94892f3950");
    CHECK(contentHash(std::as_bytes(std::span(abc))) != contentHash(std::as_bytes(std::span(abd))));
}
