// SPDX-License-Identifier: Apache-2.0
// The checksum that our .vdb files carry. OpenVDB gives every file a random UUID. Ours is a custom UUID (version 8 of
// RFC 9562) made of the XXH3 hash of all other bytes: equal content gives equal files, and a reader can tell damage
// before it parses anything.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace nerfvdb {

// A .vdb begins: int64 magic, uint32 format, uint32 library major and minor, one byte "has grid offsets", then
// the UUID as 36 characters.
inline constexpr std::size_t kVdbUuidBegin = 21, kVdbUuidSize = 36;

/// What the bytes of a file say of its origin.
enum class VdbSeal {
    not_vdb,  // no .vdb header
    foreign,  // a .vdb whose UUID is not a hash: another program wrote it
    broken,   // a UUID of our kind that is not the hash of the content
    intact,
};

/// Judges a file from all its bytes; they are left as they came.
VdbSeal checkVdbSeal(std::string& bytes);

/// Puts the UUID that belongs to them into a file's bytes, in place of the one that is there. Bytes too few for a
/// UUID are left alone.
void sealVdb(std::string& bytes);

/// True if `bytes` begin as every .vdb does.
bool hasVdbMagic(std::string_view bytes);

/// True if `bytes`, of which the first few are enough, begin a .vdb that another program wrote.
bool isForeignVdb(std::string_view bytes);

}  // namespace nerfvdb
