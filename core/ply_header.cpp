// SPDX-License-Identifier: Apache-2.0
#include "core/ply_header.h"

#include <algorithm>
#include <charconv>
#include <sstream>

#include "core/error.h"

namespace nerfvdb {

std::size_t PlyElement::size() const { return offset(static_cast<int>(properties.size())); }

int PlyElement::find(std::string_view property) const {
    const auto found = std::find_if(properties.begin(), properties.end(), [&](const PlyProperty& p) { return p.name == property; });
    return found == properties.end() ? -1 : static_cast<int>(found - properties.begin());
}

std::size_t PlyElement::offset(int property) const {
    std::size_t bytes = 0;
    for (int p = 0; p < property; ++p) {
        if (properties[p].isList()) return 0;
        bytes += properties[p].size;
    }
    return bytes;
}

const PlyElement* PlyHeader::find(std::string_view element) const {
    const auto found = std::find_if(elements.begin(), elements.end(), [&](const PlyElement& e) { return e.name == element; });
    return found == elements.end() ? nullptr : &*found;
}

std::size_t plyTypeSize(std::string_view type) {
    const auto isOneOf = [&](auto... names) { return ((type == names) || ...); };
    if (isOneOf("char", "uchar", "int8", "uint8")) return 1;
    if (isOneOf("short", "ushort", "int16", "uint16")) return 2;
    if (isOneOf("int", "uint", "float", "int32", "uint32", "float32")) return 4;
    return isOneOf("double", "float64") ? 8 : 0;
}

PlyHeader parsePlyHeader(const std::string& where, std::string_view bytes) {
    constexpr std::string_view kBegin = "ply", kEnd = "\nend_header";
    constexpr std::size_t kLongest = 1 << 16;
    const std::size_t last = bytes.substr(0, kLongest).find(kEnd);
    const std::size_t end = last == bytes.npos ? last : bytes.find('\n', last + kEnd.size());
    if (!bytes.starts_with(kBegin) || end == bytes.npos)
        throw DataError(where, "no PLY header", "a file that begins with \"ply\" and has \"end_header\"");
    PlyHeader header;
    header.end = end + 1;
    std::istringstream lines(std::string(bytes.substr(kBegin.size(), last - kBegin.size())));
    bool has_format = false;
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string word, type;
        words >> word >> type;
        const auto fail = [&](const char* expected) { throw DataError(where + ": header", "\"" + line + "\"", expected); };
        if (word == "format") {
            if (type != "ascii" && type != "binary_little_endian") fail("\"format binary_little_endian 1.0\" or \"format ascii 1.0\"");
            header.is_text = type == "ascii";
            has_format = true;
        } else if (word == "element") {
            PlyElement element{type, 0, {}};
            std::string count;
            words >> count;
            const auto [rest, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
            if (error != std::errc() || rest != count.data() + count.size()) fail("\"element vertex N\"");
            header.elements.push_back(element);
        } else if (word == "property") {
            if (header.elements.empty()) fail("an element before its properties");
            PlyProperty property;
            property.type = type;
            if (type == "list") words >> property.count_type >> property.type;
            words >> property.name;
            property.size = plyTypeSize(property.type);
            if (!words || property.size == 0 || (property.isList() && plyTypeSize(property.count_type) == 0))
                fail("\"property float x\" or \"property list uchar int vertex_indices\"");
            header.elements.back().properties.push_back(property);
        } else if (!word.empty() && word != "comment" && word != "obj_info") {
            fail("format, element, property or comment");
        }
    }
    if (!has_format) throw DataError(where, "a header without a format", "\"format binary_little_endian 1.0\" or \"format ascii 1.0\"");
    return header;
}

}  // namespace nerfvdb
