// SPDX-License-Identifier: Apache-2.0
// What stands at the beginning of a .ply (Turk 1994, "The PLY polygon file format"): elements and their properties.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace nerfvdb {

struct PlyProperty {
    std::string name;
    std::string type;         // "float"; of a list, its entries'
    std::string count_type;   // of a list's length; empty: no list
    std::size_t size = 0;     // of one number of `type`, bytes
    bool isList() const { return !count_type.empty(); }
};

struct PlyElement {
    std::string name;         // "vertex"
    std::size_t count = 0;    // as stated: not yet held against the file
    std::vector<PlyProperty> properties;

    /// Bytes of one in a binary file; 0 with a list.
    std::size_t size() const;
    /// Number of a property, or -1.
    int find(std::string_view property) const;
    /// Bytes before property number `property` in a binary file without lists.
    std::size_t offset(int property) const;
};

struct PlyHeader {
    bool is_text = false;     // else binary, little-endian
    std::vector<PlyElement> elements;
    std::size_t end = 0;      // where the elements begin

    /// The element of that name, or null.
    const PlyElement* find(std::string_view element) const;
};

/// Bytes of a number type, in PLY's old names or new ones; 0 for what is none.
std::size_t plyTypeSize(std::string_view type);

/// Throws DataError at `where`: no header, another format than those two, a line that says nothing known.
PlyHeader parsePlyHeader(const std::string& where, std::string_view bytes);

}  // namespace nerfvdb
