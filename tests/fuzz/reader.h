// SPDX-License-Identifier: Apache-2.0
// What every target shares: a place where the input lies as a file, and what a reader may do with it: return, or throw
// an Error. Anything else (a signal, another exception, a promise that does not hold) ends the program.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "core/error.h"
#include "tests/support/temp_dir.h"

/// One input. libFuzzer calls it with bytes of its own making, replay.cpp with those of files.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace nerfvdb::fuzz {

inline std::string_view textOf(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

/// This process's own folder.
inline const std::filesystem::path& folder() {
    static const TempDir dir;
    return dir.path();
}

/// Lays bytes into a file of that folder, over what was there.
inline std::filesystem::path fileOf(std::string_view bytes, const std::string& name) {
    const std::filesystem::path path = folder() / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
}

/// True if it returned, false if it threw an Error.
template <typename Read>
bool isRead(const Read& read) {
    try {
        read();
        return true;
    } catch (const Error&) {
        return false;
    }
}

/// A promise about what was read.
inline void require(bool holds, const char* promise) {
    if (holds) return;
    std::fprintf(stderr, "broken promise: %s\n", promise);
    std::abort();
}

/// True if a path leads to no place outside of a folder, as it is written.
inline bool liesInside(const std::filesystem::path& path, const std::filesystem::path& outer) {
    const std::filesystem::path relative = path.lexically_normal().lexically_relative(outer.lexically_normal());
    return !relative.empty() && *relative.begin() != "..";
}

}  // namespace nerfvdb::fuzz
