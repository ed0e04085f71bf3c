// SPDX-License-Identifier: Apache-2.0
#include "trainer/ply_points.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/ply_header.h"

namespace nerfvdb {
namespace {

constexpr const char* kAdvice = "write the points anew";

[[noreturn]] void failAt(const std::string& where, std::size_t vertex, const char* found) {
    throw DataError(where + ": vertex " + std::to_string(vertex), found, "as many numbers as its properties", kAdvice);
}

/// Numbers of a text, one after the other.
class Words {
public:
    explicit Words(std::string_view text) : text_(text) {}
    bool next(double& value) {
        constexpr std::string_view kSpace = " \t\r\n";
        const std::size_t begin = text_.find_first_not_of(kSpace);
        if (begin == text_.npos) return false;
        text_.remove_prefix(begin);
        const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), value);
        const std::string_view word = text_.substr(0, static_cast<std::size_t>(end - text_.data()));
        if (error == std::errc::invalid_argument) return false;
        if (error == std::errc::result_out_of_range) value = word.find("e-") == word.npos && word.find("E-") == word.npos ? HUGE_VAL : 0;
        text_.remove_prefix(word.size());
        return text_.empty() || kSpace.find(text_.front()) != kSpace.npos;
    }

private:
    std::string_view text_;
};

double numberAt(const char* bytes, const PlyProperty& property) {
    if (property.size == 8) {
        double value;
        std::memcpy(&value, bytes, sizeof value);
        return value;
    }
    float value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

}  // namespace

std::vector<Vec3d> readPlyPoints(const std::filesystem::path& path) {
    const std::string where = path.string(), bytes = readFile(path);
    const PlyHeader header = parsePlyHeader(where, bytes);
    const PlyElement* const vertex = header.elements.empty() ? nullptr : &header.elements.front();
    if (!vertex || vertex->name != "vertex") throw DataError(where, "no vertices first", "\"element vertex N\"", kAdvice);
    const std::array<int, 3> axes = {vertex->find("x"), vertex->find("y"), vertex->find("z")};
    for (const PlyProperty& property : vertex->properties)
        if (property.isList()) throw DataError(where, "a list in each vertex", "numbers", kAdvice);
    for (const int axis : axes)
        if (axis < 0 || !(vertex->properties[axis].type.starts_with("float") || vertex->properties[axis].size == 8))
            throw DataError(where, "vertices without float or double x, y and z", "points", kAdvice);

    // A vertex takes its bytes, or two characters a number (the last one's end may be the file's): a count cannot promise more.
    const std::size_t n_properties = vertex->properties.size(), body = bytes.size() - header.end;
    if (vertex->count > (header.is_text ? (body + 1) / (2 * n_properties) : body / vertex->size()))
        throw DataError(where, std::to_string(body) + " bytes after the header", std::to_string(vertex->count) + " vertices",
                        "the file is truncated");
    std::vector<Vec3d> points(vertex->count);
    Words words(std::string_view(bytes).substr(header.end));
    std::vector<double> numbers(n_properties);
    for (std::size_t v = 0; v < points.size(); ++v)
        if (header.is_text) {
            for (double& number : numbers)
                if (!words.next(number)) failAt(where, v, "too few numbers, or none");
            for (int a = 0; a < 3; ++a) points[v][a] = numbers[axes[a]];
        } else {
            const char* const at = bytes.data() + header.end + v * vertex->size();
            for (int a = 0; a < 3; ++a) points[v][a] = numberAt(at + vertex->offset(axes[a]), vertex->properties[axes[a]]);
        }
    return points;
}

}  // namespace nerfvdb
