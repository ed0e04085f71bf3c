// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_output.h"

#include <algorithm>
#include <charconv>
#include <cstring>

#include "core/atomic_file.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

/// Reads a line word by word; every step says whether what it expected was there.
class LineReader {
public:
    explicit LineReader(std::string_view text) : rest_(text) {}

    /// Goes behind the first place where `words` stand.
    bool find(std::string_view words) {
        const std::size_t at = rest_.find(words);
        if (at == std::string_view::npos) return false;
        rest_.remove_prefix(at + words.size());
        return true;
    }
    bool expect(std::string_view words) {
        if (!rest_.starts_with(words)) return false;
        rest_.remove_prefix(words.size());
        return true;
    }
    bool number(std::int64_t& value) {
        while (rest_.starts_with(' ')) rest_.remove_prefix(1);
        const auto result = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
        if (result.ec != std::errc()) return false;
        rest_.remove_prefix(static_cast<std::size_t>(result.ptr - rest_.data()));
        return true;
    }
    /// "12/60"
    bool share(std::int64_t& part, std::int64_t& whole) { return number(part) && expect("/") && number(whole); }

private:
    std::string_view rest_;
};

using Kind = ColmapLine::Kind;

/// "Matching block [2/3, 1/3] in 1.0s": the blocks form a square, row by row.
std::optional<ColmapLine> parseBlock(LineReader line) {
    std::int64_t row = 0, rows = 0, column = 0, columns = 0;
    if (!line.share(row, rows) || !line.expect(", ") || !line.share(column, columns)) return std::nullopt;
    constexpr std::int64_t kMost = 1 << 30;
    for (const std::int64_t number : {row, rows, column, columns})
        if (number < 0 || number > kMost) return std::nullopt;
    return ColmapLine{Kind::block_done, (row - 1) * columns + column, rows * columns};
}

/// Little-endian values from a file in memory.
class ByteReader {
public:
    explicit ByteReader(const fs::path& path) : path_(path), bytes_(readFile(path)) {}

    template <typename T>
    T get() {
        T value;
        std::memcpy(&value, take(sizeof value), sizeof value);
        return value;
    }
    std::string textToZero() {
        const std::size_t end = bytes_.find('\0', at_);
        if (end == std::string::npos) failShort();
        std::string text = bytes_.substr(at_, end - at_);
        at_ = end + 1;
        return text;
    }
    void skip(std::uint64_t count, std::uint64_t size) {
        if (count > (bytes_.size() - at_) / size) failShort();
        at_ += static_cast<std::size_t>(count * size);
    }

private:
    const char* take(std::size_t size) {
        if (size > bytes_.size() - at_) failShort();
        at_ += size;
        return bytes_.data() + at_ - size;
    }
    [[noreturn]] void failShort() const {
        throw DataError(path_.string(), "a file cut short at byte " + std::to_string(bytes_.size()),
                        "a whole COLMAP model", "run prepare again with --force");
    }

    fs::path path_;
    std::string bytes_;
    std::size_t at_ = 0;
};

/// images.bin: per photograph id, pose (quaternion, translation), camera, name, points seen (x, y, id of the point).
std::vector<std::string> registeredNames(const fs::path& path) {
    ByteReader file(path);
    const auto count = file.get<std::uint64_t>();
    std::vector<std::string> names;
    for (std::uint64_t i = 0; i < count; ++i) {
        file.skip(1, sizeof(std::uint32_t) + 7 * sizeof(double) + sizeof(std::uint32_t));
        names.push_back(file.textToZero());
        file.skip(file.get<std::uint64_t>(), 2 * sizeof(double) + sizeof(std::uint64_t));
    }
    std::sort(names.begin(), names.end());
    return names;
}

}  // namespace

std::optional<ColmapLine> parseColmapLine(std::string_view text) {
    ColmapLine told{};
    if (LineReader line(text); line.find("Processed file [") && line.share(told.done, told.total)) {
        told.kind = Kind::file_done;
        return told;
    }
    if (LineReader line(text); line.find("Features:") && line.number(told.done)) {
        told.kind = Kind::features;
        return told;
    }
    for (const char* words : {"Matching block [", "Processing block ["})
        if (LineReader line(text); line.find(words)) return parseBlock(line);
    for (const char* words : {"Matching image [", "Processing image ["})
        if (LineReader line(text); line.find(words) && line.share(told.done, told.total)) {
            told.kind = Kind::image_matched;
            return told;
        }
    if (LineReader line(text); line.find("Initializing with image pair"))
        return ColmapLine{Kind::model_begun, 2, 0};
    if (LineReader line(text); line.find("Registering image #") && line.find("(")) {
        const bool counts_before = line.expect("num_reg_frames=");  // 3.8 counts the new photograph too
        if (!line.number(told.done)) return std::nullopt;
        told.done += counts_before;
        told.kind = Kind::image_registered;
        return told;
    }
    return std::nullopt;
}

std::vector<std::string> colmapOptions(const std::vector<std::string>& help) {
    std::vector<std::string> options;
    for (const std::string& line : help) {
        const std::size_t begin = line.find("--");
        if (begin == std::string::npos || line.find_first_not_of(' ') != begin) continue;
        options.push_back(line.substr(begin + 2, line.find(' ', begin) - begin - 2));
    }
    return options;
}

std::vector<ColmapModel> listColmapModels(const fs::path& folder) {
    std::vector<ColmapModel> models;
    if (!fs::is_directory(folder)) return models;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const fs::path images = entry.path() / "images.bin", points = entry.path() / "points3D.bin";
        if (!fs::exists(images) || !fs::exists(points) || !fs::exists(entry.path() / "cameras.bin")) continue;
        models.push_back({entry.path(), registeredNames(images),
                          static_cast<std::size_t>(ByteReader(points).get<std::uint64_t>())});
    }
    std::sort(models.begin(), models.end(), [](const ColmapModel& a, const ColmapModel& b) {
        if (a.registered.size() != b.registered.size()) return a.registered.size() > b.registered.size();
        if (a.points != b.points) return a.points > b.points;
        return a.folder < b.folder;
    });
    return models;
}

}  // namespace nerfvdb
