// SPDX-License-Identifier: Apache-2.0
#include "cli/output_path.h"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {

namespace {

void makeFolder(const std::string& where, const std::filesystem::path& folder) {
    const std::string place = where + " " + folder.string();
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error || !std::filesystem::is_directory(folder))
        throw IoError(place, error ? error.message() : "something that is no folder", "a folder",
                      "name one that exists or can be made");

    // Permission bits do not tell everything (read-only mounts, full disks): write and see.
    std::string probe = (folder / ".nerfvdb-probe-XXXXXX").string();
    const int file = mkstemp(probe.data());
    if (file < 0)
        throw IoError(place, std::strerror(errno), "a folder that can be written", "choose another place");
    close(file);
    std::filesystem::remove(probe, error);
}

}  // namespace

void prepareOutputFolder(const std::string& where, const std::filesystem::path& folder) {
    makeFolder(where, folder);
    removeOrphans(folder);
}

void prepareOutputFile(const std::string& where, const std::filesystem::path& file) {
    if (file.filename().empty() || std::filesystem::is_directory(file))
        throw IoError(where + " " + file.string(), "a folder", "the name of a file", "add a file name");
    makeFolder(where, file.has_parent_path() ? file.parent_path() : std::filesystem::path("."));
    removeOrphans(file);
}

}  // namespace nerfvdb
