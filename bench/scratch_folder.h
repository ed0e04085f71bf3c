// SPDX-License-Identifier: Apache-2.0
// A folder for files that nobody wants to keep.
#pragma once

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "core/error.h"

namespace nerfvdb {

/// Makes an empty folder of its own inside `parent` and removes it with all that is in it. Throws IoError.
class ScratchFolder {
public:
    explicit ScratchFolder(const std::filesystem::path& parent) {
        std::string name = (parent / ".nerfvdb-bench-XXXXXX").string();
        if (!mkdtemp(name.data()))
            throw IoError(parent.string(), std::strerror(errno), "a folder that can be written",
                          "choose another place with --out");
        path_ = name;
    }
    ~ScratchFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    ScratchFolder(const ScratchFolder&) = delete;
    ScratchFolder& operator=(const ScratchFolder&) = delete;

    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

private:
    std::filesystem::path path_;
};

}  // namespace nerfvdb
