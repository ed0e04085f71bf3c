// SPDX-License-Identifier: Apache-2.0
// Layout: the header (vdb_seal.h), uint32 count, then for each value its name and the name of its type (uint32 length,
// characters), uint32 length in bytes, the bytes. Source: openvdb/io/Archive.cc and MetaMap.cc.
#include "vdb/vdb_metadata.h"

#include "core/byte_reader.h"
#include "vdb/vdb_seal.h"

namespace nerfvdb {
namespace {

constexpr std::uint32_t kOldestFormat = 222;  // before it the header told the compression, too

std::string readText(ByteReader& in, const char* what) {
    const auto text = in.take(in.number<std::uint32_t>(what), what);
    return {text.begin(), text.end()};
}

}  // namespace

std::map<std::string, VdbValue> readVdbMetadata(std::span<const std::uint8_t> file, const std::string& where) {
    ByteReader in(file, where);
    in.number<std::uint64_t>("a .vdb header");
    if (const auto format = in.number<std::uint32_t>("a .vdb header"); format < kOldestFormat)
        throw DataError(where, "the .vdb format " + std::to_string(format),
                        "at least " + std::to_string(kOldestFormat));
    in.take(kVdbUuidBegin + kVdbUuidSize - sizeof(std::uint64_t) - sizeof(std::uint32_t), "a .vdb header");
    std::map<std::string, VdbValue> values;
    for (auto count = in.number<std::uint32_t>("a count of metadata"); count > 0; --count) {
        const std::string name = readText(in, "the name of a value");
        const std::string type = readText(in, "the type of a value");
        values[name] = {type, in.take(in.number<std::uint32_t>("the length of a value"), "a value")};
    }
    return values;
}

}  // namespace nerfvdb
