// SPDX-License-Identifier: Apache-2.0
// "OpenEXR File Layout": magic number, version and flags; a header is attributes (name, 0, type, 0, length, value)
// up to an empty name. A file of several parts has a header for each, up to an empty one.
#include "core/exr_header.h"

#include <array>
#include <cstdint>
#include <istream>
#include <optional>

namespace nerfvdb {
namespace {

std::optional<std::uint32_t> readLittleEndian(std::istream& stream) {
    std::array<char, 4> bytes;
    if (!stream.read(bytes.data(), bytes.size())) return std::nullopt;
    std::uint32_t value = 0;
    for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<std::uint8_t>(bytes[i]);
    return value;
}

/// The length of the word that ends with a 0 here.
std::optional<int> skipWord(std::istream& stream) {
    constexpr int kLongest = 255;
    for (int length = 0; length <= kLongest; ++length) {
        const int c = stream.get();
        if (c == std::istream::traits_type::eof()) return std::nullopt;
        if (c == 0) return length;
    }
    return std::nullopt;
}

}  // namespace

bool isTruncatedExrHeader(std::istream& stream) {
    constexpr std::uint32_t kMultiPart = 0x1000;
    stream.seekg(0, std::ios::end);
    const std::streamoff size = stream.tellg();
    stream.seekg(4);
    const auto version = readLittleEndian(stream);
    if (!version) return true;
    int attributes = 0;
    for (;;) {
        const auto name = skipWord(stream);
        if (!name) return true;
        if (*name == 0) {
            if (attributes == 0 || !(*version & kMultiPart)) return false;
            attributes = 0;
            continue;
        }
        if (!skipWord(stream)) return true;
        const auto length = readLittleEndian(stream);
        if (!length || *length > size - stream.tellg()) return true;
        stream.seekg(*length, std::ios::cur);
        ++attributes;
    }
}

}  // namespace nerfvdb
