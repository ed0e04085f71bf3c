// SPDX-License-Identifier: Apache-2.0
// Is a text well-formed XML, as far as programs write it? Tags in pairs, attributes in double quotes, no stray
// < or &.
#pragma once

#include <cctype>
#include <string>
#include <vector>

namespace nerfvdb::test {

namespace xml_detail {

inline bool isNameChar(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == ':';
}

/// A problem with entities in text[begin, end), or nothing.
inline std::string entityProblem(const std::string& text, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
        if (text[i] == '<') return "stray < at " + std::to_string(i);
        if (text[i] != '&') continue;
        bool is_known = false;
        for (const char* entity : {"&amp;", "&lt;", "&gt;", "&quot;", "&apos;"})
            is_known = is_known || text.compare(i, std::string(entity).size(), entity) == 0;
        if (!is_known) return "stray & at " + std::to_string(i);
    }
    return {};
}

}  // namespace xml_detail

/// The first problem, or an empty text. Knows elements, attributes, text and the declaration; no comments, no
/// CDATA.
inline std::string xmlProblem(const std::string& text) {
    using namespace xml_detail;
    std::vector<std::string> open;
    std::size_t i = text.rfind("<?xml", 0) == 0 ? text.find("?>") + 2 : 0;
    bool had_root = false;
    while (i < text.size()) {
        const std::size_t tag = std::min(text.find('<', i), text.size());
        if (const std::string problem = entityProblem(text, i, tag); !problem.empty()) return problem;
        if (open.empty() && text.find_first_not_of(" \n", i) < tag) return "text outside the root";
        if (tag == text.size()) break;
        std::size_t at = tag + 1;
        const bool closes = at < text.size() && text[at] == '/';
        if (closes) ++at;
        std::string name;
        while (at < text.size() && isNameChar(text[at])) name += text[at++];
        if (name.empty()) return "a tag without a name at " + std::to_string(tag);
        std::vector<std::string> attributes;
        while (at < text.size() && text[at] == ' ') {
            ++at;
            std::string attribute;
            while (at < text.size() && isNameChar(text[at])) attribute += text[at++];
            if (attribute.empty() || text.compare(at, 2, "=\"") != 0)
                return "a bad attribute in <" + name + ">";
            for (const std::string& other : attributes)
                if (other == attribute) return "attribute twice in <" + name + ">: " + attribute;
            attributes.push_back(attribute);
            const std::size_t end = text.find('"', at + 2);
            if (end == std::string::npos) return "an open quote in <" + name + ">";
            if (const std::string problem = entityProblem(text, at + 2, end); !problem.empty()) return problem;
            at = end + 1;
        }
        const bool is_alone = at < text.size() && text[at] == '/';
        if (is_alone) ++at;
        if (at >= text.size() || text[at] != '>') return "an open tag <" + name;
        if (closes) {
            if (open.empty() || open.back() != name) return "</" + name + "> closes nothing";
            open.pop_back();
        } else {
            if (open.empty() && had_root) return "a second root <" + name + ">";
            had_root = true;
            if (!is_alone) open.push_back(name);
        }
        i = at + 1;
    }
    if (!open.empty()) return "<" + open.back() + "> is never closed";
    return had_root ? "" : "no element";
}

}  // namespace nerfvdb::test
