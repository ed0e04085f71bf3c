// SPDX-License-Identifier: Apache-2.0
// EXIF is a TIFF file in a segment of its own (CIPA DC-008, 4.5 and 4.6): byte order, magic number, offset of the first
// directory; a directory is a count and entries of tag, type, count, value. JPEG: ITU-T T.81, annex B.1.1; PNG: eXIf.
#include "core/exif_header.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <istream>
#include <string_view>

#include "core/png_chunks.h"

namespace nerfvdb {
namespace {

constexpr int kMostNested = 8;          // a camera's: 3, the maker note inside of the private directory inside of the first
constexpr int kMostEntries = 1 << 16;   // a camera's: some hundreds

std::uint32_t numberAt(std::string_view bytes, std::size_t begin, int count, bool is_big_endian) {
    std::uint32_t value = 0;
    for (int i = 0; i < count; ++i)
        value = value << 8 | static_cast<std::uint8_t>(bytes[begin + static_cast<std::size_t>(is_big_endian ? i : count - 1 - i)]);
    return value;
}

class Directories {
public:
    explicit Directories(std::string_view tiff) : tiff_(tiff), is_big_endian_(tiff.starts_with("MM")) {}

    bool areSound() {
        constexpr std::size_t kHead = 8;
        const bool is_tiff = tiff_.size() >= kHead && (is_big_endian_ || tiff_.starts_with("II"));
        return !is_tiff || isSound(numberAt(tiff_, 4, 4, is_big_endian_), 1);
    }

private:
    bool isSound(std::size_t begin, int depth) {
        constexpr std::size_t kEntry = 12, kValue = 8;
        if (depth > kMostNested) return false;
        if (begin + 2 > tiff_.size()) return true;
        std::uint32_t left = numberAt(tiff_, begin, 2, is_big_endian_);
        for (std::size_t entry = begin + 2; left > 0 && entry + kEntry <= tiff_.size(); --left, entry += kEntry) {
            if (++n_entries_ > kMostEntries) return false;
            const std::uint32_t tag = numberAt(tiff_, entry, 2, is_big_endian_);
            if (!isPointer(tag)) continue;
            if (!isSound(numberAt(tiff_, entry + kValue, 4, is_big_endian_), depth + 1)) return false;
            // What is taken for a value that is no pointer stays in the file's order of bytes.
            if (tag == kMakerNote && !isSound(numberAt(tiff_, entry + kValue, 4, !is_big_endian_), depth + 1)) return false;
        }
        return true;
    }

    static constexpr std::uint32_t kPrivate = 0x8769, kPosition = 0x8825, kInteroperability = 0xA005, kMakerNote = 0x927C;
    static bool isPointer(std::uint32_t tag) {
        return tag == kPrivate || tag == kPosition || tag == kInteroperability || tag == kMakerNote;
    }

    std::string_view tiff_;
    bool is_big_endian_;
    int n_entries_ = 0;
};

bool isSoundExif(std::string_view segment) {
    constexpr std::size_t kName = 6;  // "Exif" and two zeros
    if (segment.starts_with("Exif") && segment.size() >= kName) segment.remove_prefix(kName);
    return Directories(segment).areSound();
}

/// The next bytes, or as many as there are.
std::string take(std::istream& file, std::size_t count) {
    std::string bytes(count, '\0');
    file.read(bytes.data(), static_cast<std::streamsize>(count));
    bytes.resize(static_cast<std::size_t>(file.gcount()));
    return bytes;
}

/// Up to the first scan: what follows is no header. Bytes between segments are passed by, as decoders do.
bool isSoundJpeg(std::istream& file) {
    constexpr int kScan = 0xDA, kEnd = 0xD9, kApplication1 = 0xE1, kRestart0 = 0xD0, kStart = 0xD8, kTemporary = 0x01;
    while (file) {
        if (file.get() != 0xFF) continue;
        int marker = file.get();
        while (marker == 0xFF) marker = file.get();
        if (marker == 0x00 || (marker >= kRestart0 && marker <= kStart) || marker == kTemporary) continue;
        if (marker == kScan || marker == kEnd) break;
        const std::string head = take(file, 2);
        if (head.size() < 2) break;
        const std::size_t length = numberAt(head, 0, 2, true);  // these two bytes counted
        if (length < 2) break;
        if (marker != kApplication1) file.seekg(static_cast<std::streamoff>(length - 2), std::ios::cur);
        else if (!isSoundExif(take(file, length - 2))) return false;
    }
    return true;
}

/// Up to the pixels.
bool isSoundPng(std::istream& file) {
    for (PngChunks chunks(file); chunks.next() && chunks.type() != "IDAT";)
        if (chunks.type() == "eXIf" && !isSoundExif(chunks.data())) return false;
    return true;
}

}  // namespace

std::string exifProblem(std::istream& file) {
    file.clear();
    file.seekg(0);
    const std::string first = take(file, 2);
    const bool is_sound = first == "\xFF\xD8"  ? isSoundJpeg(file)
                          : first == "\x89P" ? isSoundPng(file)
                                             : true;
    return is_sound ? "" : "EXIF directories that lead into each other without end";
}

}  // namespace nerfvdb
