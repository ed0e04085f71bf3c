// SPDX-License-Identifier: Apache-2.0
// The chunks of a PNG, without their data: libpng takes memory for one as long as it says, before the file has shown that
// it holds so much.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>

namespace nerfvdb {

/// Walks through the chunks of the PNG in `file` (seekable, binary), its signature passed by.
class PngChunks {
public:
    explicit PngChunks(std::istream& file);

    bool next();  // goes to the next chunk; false: the file ends before one
    const std::string& type() const { return type_; }
    std::uint32_t length() const { return length_; }  // of the data, bytes, as stated
    std::int64_t left() const;                        // bytes of the file after the chunk's head
    std::string data();                               // or as much of it as there is

private:
    std::istream& file_;
    std::int64_t size_ = 0, data_ = 0, next_ = 0;  // places in the file
    std::string type_;
    std::uint32_t length_ = 0;
};

/// What is wrong with the chunks of the PNG in `file`, in a few words: one that is not of pixels, and that decoders look at, is
/// longer than the file. Empty: nothing, or no PNG. Leaves the stream anywhere.
std::string pngChunkProblem(std::istream& file);

}  // namespace nerfvdb
