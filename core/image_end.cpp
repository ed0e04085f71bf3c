// SPDX-License-Identifier: Apache-2.0
// PNG: W3C "Portable Network Graphics" 5.3, chunks of length, type, data, CRC.
// JPEG: ITU-T T.81, annex B.1.1, marker segments; entropy-coded data stuffs a zero after each 0xFF.
#include "core/image_end.h"

#include <cstddef>
#include <cstdint>

namespace nerfvdb {
namespace {

std::uint8_t byteAt(std::string_view bytes, std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); }

std::size_t bigEndian(std::string_view bytes, std::size_t begin, int count) {
    std::size_t value = 0;
    for (int i = 0; i < count; ++i) value = value << 8 | byteAt(bytes, begin + i);
    return value;
}

bool isTruncatedPng(std::string_view bytes) {
    constexpr std::size_t kSignature = 8, kFrame = 12;  // frame: length 4, type 4, CRC 4
    std::size_t pos = kSignature;
    while (pos + kFrame <= bytes.size()) {
        const std::size_t length = bigEndian(bytes, pos, 4);
        const std::string_view type = bytes.substr(pos + 4, 4);
        if (length > bytes.size() - pos - kFrame) return true;
        if (type == "IEND") return false;
        pos += kFrame + length;
    }
    return true;
}

bool isTruncatedJpeg(std::string_view bytes) {
    constexpr std::uint8_t kRestart0 = 0xD0, kRestart7 = 0xD7, kEnd = 0xD9, kTemporary = 0x01;
    const auto isRestart = [&](std::uint8_t marker) { return marker >= kRestart0 && marker <= kRestart7; };

    std::size_t pos = 2;  // after the start mark
    while (pos + 1 < bytes.size()) {
        // A marker is 0xFF and a byte that is neither 0 (stuffing) nor 0xFF (padding); what lies between is
        // entropy-coded data.
        const std::uint8_t marker = byteAt(bytes, pos + 1);
        if (byteAt(bytes, pos) != 0xFF || marker == 0x00 || marker == 0xFF) {
            ++pos;
            continue;
        }
        pos += 2;
        if (marker == kEnd) return false;
        if (isRestart(marker) || marker == kTemporary) continue;
        if (pos + 2 > bytes.size()) return true;
        pos += bigEndian(bytes, pos, 2);  // jumps over thumbnails, which have end marks of their own
    }
    return true;
}

}  // namespace

bool isTruncatedImage(std::string_view bytes) {
    using namespace std::string_view_literals;
    if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv)) return isTruncatedPng(bytes);
    if (bytes.starts_with("\xFF\xD8\xFF"sv)) return isTruncatedJpeg(bytes);
    return false;
}

}  // namespace nerfvdb
