// SPDX-License-Identifier: Apache-2.0
// The metadata of a .vdb file, read without OpenVDB: its parser believes every length that a file states.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>

namespace nerfvdb {

/// A value of any type, as its bytes lie in the file.
struct VdbValue {
    std::string type;  // OpenVDB's name: "int32", "double", "vec3d", "string", ...
    std::span<const std::uint8_t> bytes;
};

/// The file-level metadata by name; values are views into `file`, all bytes of a .vdb. Throws DataError at `where`:
/// lengths that the file cannot hold, a format whose header is another.
std::map<std::string, VdbValue> readVdbMetadata(std::span<const std::uint8_t> file, const std::string& where);

}  // namespace nerfvdb
