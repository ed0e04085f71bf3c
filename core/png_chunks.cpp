// SPDX-License-Identifier: Apache-2.0
// W3C "Portable Network Graphics" 5.3: a chunk is length, type, data and check.
#include "core/png_chunks.h"

#include <algorithm>
#include <istream>

namespace nerfvdb {
namespace {

constexpr std::int64_t kSignature = 8, kHead = 8, kCheck = 4;

std::string takeAt(std::istream& file, std::int64_t begin, std::int64_t count) {
    std::string bytes(static_cast<std::size_t>(count), '\0');
    file.clear();
    file.seekg(begin);
    file.read(bytes.data(), count);
    bytes.resize(static_cast<std::size_t>(file.gcount()));
    return bytes;
}

}  // namespace

PngChunks::PngChunks(std::istream& file) : file_(file), next_(kSignature) {
    file_.clear();
    file_.seekg(0, std::ios::end);
    size_ = file_.tellg();
}

bool PngChunks::next() {
    const std::string head = takeAt(file_, next_, kHead);
    if (std::ssize(head) < kHead) return false;
    length_ = 0;
    for (int i = 0; i < 4; ++i) length_ = length_ << 8 | static_cast<std::uint8_t>(head[static_cast<std::size_t>(i)]);
    type_ = head.substr(4);
    data_ = next_ + kHead;
    next_ = data_ + length_ + kCheck;
    return true;
}

std::int64_t PngChunks::left() const { return size_ - data_; }

std::string PngChunks::data() { return takeAt(file_, data_, std::min<std::int64_t>(length_, left())); }

std::string pngChunkProblem(std::istream& file) {
    file.clear();
    if (takeAt(file, 0, kSignature) != "\x89PNG\r\n\x1a\n") return {};
    constexpr std::size_t kInterlace = 12;  // in IHDR
    // Chunks after the pixels are looked at where those are interlaced. There is no need to seek through all others.
    bool goes_on = false;
    for (PngChunks chunks(file); chunks.next();) {
        if (chunks.type() == "IEND" || (chunks.type() == "IDAT" && !goes_on)) break;
        if (chunks.type() == "IDAT") continue;
        if (chunks.length() > chunks.left())
            return "a chunk of " + std::to_string(chunks.length()) + " bytes where the file has " +
                   std::to_string(chunks.left()) + " left";
        if (chunks.type() == "IHDR") {
            const std::string header = chunks.data();
            goes_on = header.size() > kInterlace && header[kInterlace] != 0;
        }
    }
    return {};
}

}  // namespace nerfvdb
