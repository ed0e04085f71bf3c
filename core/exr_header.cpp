// SPDX-License-Identifier: Apache-2.0
// "OpenEXR File Layout": magic number, version and flags; a header is attributes (name, 0, type, 0, length, value)
// up to an empty name. A file of several parts has a header for each, up to an empty one.
#include "core/exr_header.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <istream>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/byte_reader.h"

namespace nerfvdb {
namespace {

/// Bytes of the types whose values are all of one length.
const std::map<std::string_view, std::uint32_t>& fixedLengths() {
    static const std::map<std::string_view, std::uint32_t> lengths{
        {"box2i", 16}, {"box2f", 16},      {"chromaticities", 32}, {"compression", 1}, {"deepImageState", 1}, {"double", 8},
        {"envmap", 1}, {"float", 4},       {"int", 4},             {"keycode", 28},    {"lineOrder", 1},      {"m33f", 36},
        {"m33d", 72},  {"m44f", 64},       {"m44d", 128},          {"rational", 8},    {"tiledesc", 9},       {"timecode", 8},
        {"v2i", 8},    {"v2f", 8},         {"v2d", 16},            {"v3i", 12},        {"v3f", 12},           {"v3d", 24}};
    return lengths;
}

/// A word up to its 0, which is taken too.
std::string takeWord(ByteReader& bytes, const char* what) {
    std::string word;
    while (const char c = bytes.number<char>(what)) word += c;
    return word;
}

void skipChannels(ByteReader& bytes) {
    constexpr std::size_t kChannel = 16;  // of pixel type, flags and sampling
    while (!takeWord(bytes, "channels").empty()) bytes.take(kChannel, "a channel");
}

void skipStrings(ByteReader& bytes) {
    while (bytes.left() > 0) bytes.take(bytes.number<std::uint32_t>("a string's length"), "a string");
}

void skipPreview(ByteReader& bytes) {
    const std::uint64_t width = bytes.number<std::uint32_t>("a width"), height = bytes.number<std::uint32_t>("a height");
    const bool are_there = width == 0 || height <= bytes.left() / 4 / width;
    bytes.take(are_there ? 4 * width * height : bytes.left() + 1, "pixels");
}

/// Lines and tiles are decoded in buffers as wide as these say.
bool isSoundBox(ByteReader bytes) {
    constexpr std::int64_t kLongestSide = 1 << 16;
    std::array<std::int64_t, 4> limits;  // low x, low y, high x, high y; both inside
    for (std::int64_t& limit : limits) limit = bytes.number<std::int32_t>("a corner");
    const std::int64_t width = limits[2] - limits[0] + 1, height = limits[3] - limits[1] + 1;
    return std::min(width, height) > 0 && std::max(width, height) <= kLongestSide;
}

bool isSoundTile(ByteReader bytes) {
    constexpr std::uint32_t kLongestSide = 4096;
    const auto width = bytes.number<std::uint32_t>("a width"), height = bytes.number<std::uint32_t>("a height");
    return std::min(width, height) > 0 && std::max(width, height) <= kLongestSide;
}

/// Is a value of this type exactly as long as these bytes, and no cause for much memory? Of types that are not listed
/// OpenEXR believes the length.
bool isSound(std::string_view type, std::span<const std::uint8_t> value) {
    ByteReader bytes(value, "value");
    if (const auto fixed = fixedLengths().find(type); fixed != fixedLengths().end())
        return value.size() == fixed->second && (type != "box2i" || isSoundBox(bytes)) &&
               (type != "tiledesc" || isSoundTile(bytes));
    try {
        if (type == "chlist") skipChannels(bytes);
        else if (type == "stringvector") skipStrings(bytes);
        else if (type == "preview") skipPreview(bytes);
        else return type != "idmanifest";  // packed: what it unpacks to is nowhere bounded; no photograph has one
    } catch (const DataError&) {
        return false;
    }
    return bytes.left() == 0;
}

}  // namespace

std::string exrHeaderProblem(std::istream& stream) {
    constexpr std::uint32_t kMultiPart = 0x1000;
    constexpr const char* kCut = "a header that the file is too short for";
    stream.clear();
    stream.seekg(0, std::ios::end);
    const std::streamoff size = stream.tellg();
    const auto number = [&](std::uint32_t& value) {
        return static_cast<bool>(stream.read(reinterpret_cast<char*>(&value), sizeof value));
    };
    const auto word = [&](std::string& text) { return static_cast<bool>(std::getline(stream, text, '\0')) && !stream.eof(); };

    std::uint32_t version = 0;
    stream.seekg(4);
    if (!number(version)) return kCut;
    std::string name, type;
    std::vector<std::uint8_t> value;
    int attributes = 0;
    while (word(name)) {
        if (name.empty()) {
            if (attributes == 0 || !(version & kMultiPart)) return {};
            attributes = 0;
            continue;
        }
        std::uint32_t length = 0;
        if (!word(type) || !number(length) || length > size - stream.tellg()) return kCut;
        value.resize(length);
        stream.read(reinterpret_cast<char*>(value.data()), length);
        if (!isSound(type, value))
            return "an attribute '" + name + "' of " + std::to_string(length) + " bytes that is no sound " + type;
        ++attributes;
    }
    return kCut;
}

}  // namespace nerfvdb
