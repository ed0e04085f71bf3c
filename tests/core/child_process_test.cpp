// SPDX-License-Identifier: Apache-2.0
#include "core/child_process.h"

#include <signal.h>

#include <chrono>
#include <cstdlib>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
namespace fs = std::filesystem;

namespace {

using Lines = std::vector<std::string>;

bool never() { return false; }

ChildEnd runScript(const std::string& script, Lines& lines, const std::function<bool()>& should_stop = never) {
    return runChild({"/bin/sh", {"-c", script}, {}},
                    [&](std::string_view line) { lines.emplace_back(line); }, should_stop);
}

double secondsSince(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

TEST_CASE("a child's words arrive line by line, from both streams", "[core]") {
    Lines lines;
    const ChildEnd end = runScript("echo one; echo two >&2; printf 'a\\rb\\r\\n\\nlast'", lines);
    CHECK(end.isGood());
    CHECK(lines == Lines{"one", "two", "a", "b", "", "last"});
}

TEST_CASE("a child's end is told: exit code or signal", "[core]") {
    Lines lines;
    CHECK(runScript("exit 7", lines).exit_code == 7);
    CHECK(!runScript("exit 7", lines).isGood());
    CHECK(runScript("kill -SEGV $$", lines).signal == SIGSEGV);
}

TEST_CASE("arguments pass as they are: there is no shell", "[core]") {
    Lines lines;
    const std::string odd = "two words; $(echo no) 'quoted' \"*\"";
    const ChildEnd end = runChild({"/bin/echo", {odd, ""}, {}},
                                  [&](std::string_view line) { lines.emplace_back(line); }, never);
    CHECK(end.isGood());
    CHECK(lines == Lines{odd + " "});
}

TEST_CASE("a child inherits the environment, with changes", "[core]") {
    setenv("NERFVDB_TEST_KEPT", "kept", 1);
    setenv("NERFVDB_TEST_CHANGED", "before", 1);
    Lines lines;
    runChild({"/bin/sh", {"-c", "echo $NERFVDB_TEST_KEPT $NERFVDB_TEST_CHANGED; cat"}, {"NERFVDB_TEST_CHANGED=after"}},
             [&](std::string_view line) { lines.emplace_back(line); }, never);
    CHECK(lines == Lines{"kept after"});  // and `cat` found standard input empty
}

TEST_CASE("a child is stopped when asked, also one that refuses or has left others behind", "[core]") {
    Lines lines;
    const auto begin = std::chrono::steady_clock::now();
    const ChildEnd gentle =
        runScript("echo up; sleep 60; echo never", lines, [&] { return !lines.empty(); });
    CHECK(gentle.is_stopped);
    CHECK(!gentle.isGood());
    CHECK(lines == Lines{"up"});
    CHECK(secondsSince(begin) < 4);  // half a minute is what a lost signal would take

    lines.clear();
    const ChildEnd stubborn = runScript("trap '' TERM; echo up; while :; do sleep 0.2; done", lines,
                                        [&] { return !lines.empty(); });
    CHECK(stubborn.is_stopped);
    CHECK(stubborn.signal == SIGKILL);

    lines.clear();
    const auto again = std::chrono::steady_clock::now();
    CHECK(runScript("sleep 60 & echo left it", lines).isGood());
    CHECK(lines == Lines{"left it"});
    CHECK(secondsSince(again) < 4);
}

TEST_CASE("an exception of the listener ends the child", "[core]") {
    const auto begin = std::chrono::steady_clock::now();
    CHECK_THROWS_AS(runChild({"/bin/sh", {"-c", "echo word; exec sleep 60"}, {}},
                             [](std::string_view) { throw DataError("heard enough"); }, never),
                    DataError);
    CHECK(secondsSince(begin) < 4);
}

TEST_CASE("a program is found on PATH as a shell finds it, or cannot be started", "[core]") {
    const TempDir dir;
    fs::create_directory(dir / "first");
    fs::create_directory(dir / "second");
    writeAtomically(dir / "first" / "tool", "no program: it may not be executed");
    writeAtomically(dir / "second" / "tool", "#!/bin/sh\necho here\n");
    fs::permissions(dir / "first" / "tool", fs::perms::owner_read);
    fs::permissions(dir / "second" / "tool", fs::perms::owner_all);
    const std::string before = std::getenv("PATH") ? std::getenv("PATH") : "";
    setenv("PATH", ((dir / "first").string() + ":" + (dir / "second").string()).c_str(), 1);
    const std::optional<fs::path> tool = findProgram("tool"), absent = findProgram("no-such-tool");
    setenv("PATH", before.c_str(), 1);
    REQUIRE(tool);
    CHECK(*tool == dir / "second" / "tool");
    CHECK(!absent);
    CHECK_THROWS_WITH(runChild({dir / "first" / "tool", {}, {}}, [](std::string_view) {}, never),
                      Catch::Contains("tool: found Permission denied, expected a program that can be started"));
}
