// SPDX-License-Identifier: Apache-2.0
// A COLMAP that does as it is told, first on PATH while it lives: see fake_colmap.sh.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "tests/support/temp_dir.h"

namespace nerfvdb::testing {

class FakeColmap {
public:
    FakeColmap() : path_before_(std::getenv("PATH")) {
        std::filesystem::create_directory(dir_ / "bin");
        std::filesystem::create_symlink(NERFVDB_SOURCE_DIR "/tests/support/fake_colmap.sh", dir_ / "bin" / "colmap");
        setenv("PATH", ((dir_ / "bin").string() + ":" + path_before_).c_str(), 1);
        setenv("FAKE_COLMAP", dir_.path().c_str(), 1);
    }
    ~FakeColmap() { setenv("PATH", path_before_.c_str(), 1); }
    FakeColmap(const FakeColmap&) = delete;
    FakeColmap& operator=(const FakeColmap&) = delete;

    /// What it shall do, by the names in fake_colmap.sh.
    void tell(const std::string& name, const std::string& text = {}) const { writeAtomically(dir_ / name, text); }
    void forget(const std::string& name) const { std::filesystem::remove(dir_ / name); }
    void makeModel(int number, const std::vector<std::string>& registered) const {
        std::string text;
        for (const std::string& name : registered) text += name + "\n";
        tell("registered." + std::to_string(number), text);
    }
    bool isHanging() const { return std::filesystem::exists(dir_ / "hanging"); }

    /// The calls since the last time this was asked, as lines "COMMAND OPTION...".
    std::vector<std::string> takeCalls() const {
        std::vector<std::string> calls;
        if (!std::filesystem::exists(dir_ / "calls")) return calls;
        std::istringstream text(readFile(dir_ / "calls"));
        for (std::string line; std::getline(text, line);) calls.push_back(line);
        forget("calls");
        return calls;
    }

private:
    TempDir dir_;
    std::string path_before_;
};

}  // namespace nerfvdb::testing
