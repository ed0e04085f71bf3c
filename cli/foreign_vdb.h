// SPDX-License-Identifier: Apache-2.0
// .vdb files that other programs wrote. No checksum guards them, and OpenVDB's parser believes what a file says: one
// that is damaged may end the program. A child process reads them first; its end costs nothing.
#pragma once

#include <filesystem>

namespace nerfvdb {

/// Reads a .vdb of another program in a child process, with limits on its memory and time; returns if that went well,
/// and at once for any other file. Throws DataError with the child's complaint, or that it died; Interrupted.
void tryForeignVdb(const std::filesystem::path& path);

}  // namespace nerfvdb
