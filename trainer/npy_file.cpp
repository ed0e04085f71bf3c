// SPDX-License-Identifier: Apache-2.0
// A file is "\x93NUMPY", uint8 major and minor version, the header's length (uint16 in version 1, else uint32), the
// header, the values. The header is a Python dict, as Python prints it:
//   {'descr': '<f8', 'fortran_order': False, 'shape': (20, 17), }
#include "trainer/npy_file.h"

#include <charconv>
#include <string>
#include <string_view>

#include "core/atomic_file.h"
#include "core/byte_reader.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr const char* kAdvice = "save it again with numpy.save";

struct Header {
    std::string type;
    bool is_fortran = false;
    std::size_t rows = 0, columns = 0;
};

/// The text after the key (with its quotes) and the colon in the header, without blanks before it.
std::string_view valueOf(std::string_view header, std::string_view key, const std::string& where) {
    std::size_t at = header.find(key);
    if (at != header.npos) at = header.find_first_not_of(" \t", at + key.size());
    if (at != header.npos && header[at] == ':') at = header.find_first_not_of(" \t", at + 1);
    if (at == header.npos) throw DataError(where, "no " + std::string(key) + " in its header", "one", kAdvice);
    return header.substr(at);
}

/// "(rows, columns)".
void readShape(std::string_view text, Header& header, const std::string& where) {
    const std::string_view shape = text.substr(0, text.find(')') + 1);
    const auto number = [](std::string_view& rest, std::size_t& value) {
        rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
        const auto [end, failure] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
        if (failure != std::errc()) return false;
        rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
        rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
        return true;
    };
    std::string_view rest = shape;
    const auto take = [&rest](char c) {
        if (!rest.starts_with(c)) return false;
        rest.remove_prefix(1);
        return true;
    };
    const bool is_matrix = take('(') && number(rest, header.rows) && take(',') && number(rest, header.columns) &&
                           (take(','), true) && rest == ")";
    if (!is_matrix)
        throw DataError(where, "the shape " + std::string(shape.substr(0, 60)), "two dimensions", kAdvice);
}

Header readHeader(std::string_view text, const std::string& where) {
    Header header;
    const std::string_view type = valueOf(text, "'descr'", where);
    header.type = type.substr(0, type.find(','));
    if (header.type != "'<f8'" && header.type != "'<f4'")
        throw DataError(where, "numbers of the type " + header.type.substr(0, 60), "'<f8' or '<f4'",
                        "save them with numpy.save(path, array.astype('<f8'))");
    const std::string_view order = valueOf(text, "'fortran_order'", where);
    header.is_fortran = order.starts_with("True");
    if (!header.is_fortran && !order.starts_with("False"))
        throw DataError(where, "a fortran_order that is neither", "True or False", kAdvice);
    readShape(valueOf(text, "'shape'", where), header, where);
    return header;
}

}  // namespace

NpyMatrix readNpyMatrix(const std::filesystem::path& file) {
    const std::string bytes = readFile(file);
    const std::string where = file.string();
    if (!bytes.starts_with(kMagic)) throw DataError(where, "no .npy file", "one that begins with \\x93NUMPY", kAdvice);
    ByteReader in({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, where,
                  "the file is cut short: copy it again");
    in.take(kMagic.size(), "a head");
    const auto major = in.number<std::uint8_t>("a version");
    in.number<std::uint8_t>("a version");
    if (major < 1 || major > 3) throw DataError(where, "version " + std::to_string(major), "1, 2 or 3", kAdvice);
    const std::size_t header_length =
        major == 1 ? in.number<std::uint16_t>("a header's length") : in.number<std::uint32_t>("a header's length");
    const auto header_bytes = in.take(header_length, "a header");
    const Header header =
        readHeader({reinterpret_cast<const char*>(header_bytes.data()), header_bytes.size()}, where);

    const std::size_t value_bytes = header.type == "'<f8'" ? sizeof(double) : sizeof(float);
    const std::size_t n_values = in.left() / value_bytes;
    const bool fits = header.columns == 0 || header.rows == 0
                          ? in.left() == 0
                          : n_values / header.columns == header.rows && n_values % header.columns == 0 &&
                                in.left() % value_bytes == 0;
    if (!fits)
        throw DataError(where, std::to_string(in.left()) + " bytes of values",
                        std::to_string(header.rows) + "x" + std::to_string(header.columns) + " of " +
                            std::to_string(value_bytes),
                        "the file is cut short or damaged: copy it again");

    NpyMatrix matrix{header.rows, header.columns, std::vector<double>(header.columns == 0 ? 0 : n_values)};
    for (std::size_t i = 0; i < matrix.values.size(); ++i) {
        const std::size_t at =
            header.is_fortran ? i % header.rows * header.columns + i / header.rows : i;
        matrix.values[at] = value_bytes == sizeof(double) ? in.number<double>("a value")
                                                          : static_cast<double>(in.number<float>("a value"));
    }
    return matrix;
}

}  // namespace nerfvdb
