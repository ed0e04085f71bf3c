// SPDX-License-Identifier: Apache-2.0
// Lines of words between blanks; empty lines and those that begin with # say nothing, except that in images.txt the line
// after an image's is its features', which may be none:
//   cameras:  ID MODEL WIDTH HEIGHT PARAMETER...
//   images:   ID QW QX QY QZ TX TY TZ CAMERA NAME, then X Y POINT (-1: none) again and again
//   points3D: ID X Y Z R G B ERROR, then IMAGE FEATURE again and again
#include "trainer/colmap_text.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "core/atomic_file.h"
#include "core/error.h"
#include "trainer/colmap_lens.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kBlanks = " \t\r";

/// The words of one line, which knows its place.
class TextLine {
public:
    TextLine(std::string_view text, std::string where) : rest_(text), where_(std::move(where)) { skipBlanks(); }

    bool isEmpty() const { return rest_.empty(); }
    bool isComment() const { return !rest_.empty() && rest_.front() == '#'; }
    /// The number that a comment says after these words.
    std::optional<std::size_t> numberAfter(std::string_view words) const {
        const std::size_t begin = rest_.find(words);
        std::size_t number = 0;
        if (begin == rest_.npos) return std::nullopt;
        const char* const digits = rest_.data() + begin + words.size();
        if (std::from_chars(digits, rest_.data() + rest_.size(), number).ec != std::errc()) return std::nullopt;
        return number;
    }

    std::string_view word(const char* what) {
        if (rest_.empty()) fail("the end of the line", what);
        const std::string_view word = rest_.substr(0, rest_.find_first_of(kBlanks));
        rest_.remove_prefix(word.size());
        skipBlanks();
        return word;
    }
    /// A number that is all of the next word. "nan" and "inf" are numbers; one that a T cannot hold is not.
    template <typename T>
    T number(const char* what) {
        const std::string_view text = word(what);
        T value{};
        const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (failure != std::errc() || end != text.data() + text.size()) fail(quoted(text), what);
        return value;
    }
    Vec3d vector(const char* what) {
        Vec3d vector;
        for (double& value : vector) value = number<double>(what);
        return vector;
    }
    /// All that is left, without blanks at its end.
    std::string_view remainder(const char* what) {
        if (rest_.empty()) fail("the end of the line", what);
        const std::string_view all = rest_.substr(0, rest_.find_last_not_of(kBlanks) + 1);
        rest_ = {};
        return all;
    }
    [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
        throw DataError(where_, found, expected, "the file is damaged or no COLMAP model: export it again");
    }
    const std::string& where() const { return where_; }

private:
    void skipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks), rest_.size())); }
    /// Garbage, made fit to be printed.
    static std::string quoted(std::string_view text) {
        std::string result = "'";
        for (const char c : text.substr(0, 40)) result += c >= 0x20 && c < 0x7f ? c : '?';
        return result + (text.size() > 40 ? "...'" : "'");
    }

    std::string_view rest_;
    std::string where_;
};

/// Calls read(line, next_line) for each entry; next_line() is the line after it, of which an absent one is empty. Throws
/// DataError when there are fewer entries than a comment says after the words `counted`.
template <typename ReadEntry>
void forEachEntry(const fs::path& file, std::string_view counted, const ReadEntry& read) {
    const std::string text = readFile(file);
    std::string_view rest = text;
    std::size_t number = 0, n_entries = 0, stated = 0;
    const auto nextLine = [&] {
        const std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(line.size() + 1, rest.size()));
        return TextLine(line, file.string() + ": line " + std::to_string(++number));
    };
    while (!rest.empty()) {
        TextLine line = nextLine();
        if (line.isComment()) stated = std::max(stated, line.numberAfter(counted).value_or(0));
        if (line.isEmpty() || line.isComment()) continue;
        read(line, nextLine);
        ++n_entries;
    }
    if (n_entries < stated)
        throw DataError(file.string(), std::to_string(n_entries) + " entries", std::to_string(stated) + ", as its head says",
                        "the file was cut short: export it again; where it was edited, correct the head");
}

}  // namespace

std::vector<ColmapCamera> readColmapCamerasText(const fs::path& file) {
    std::vector<ColmapCamera> cameras;
    forEachEntry(file, "Number of cameras: ", [&](TextLine& line, const auto&) {
        ColmapCamera camera;
        camera.id = line.number<std::uint32_t>("a camera's id");
        const ColmapLensModel& lens = colmapLensModel(std::string(line.word("a camera's model")), line.where());
        camera.model = lens.name;
        camera.width = line.number<std::uint64_t>("a width");
        camera.height = line.number<std::uint64_t>("a height");
        for (std::size_t i = 0; i < lens.n_parameters; ++i)
            camera.parameters.push_back(line.number<double>("a lens parameter"));
        if (!line.isEmpty())
            line.fail("more than " + std::to_string(lens.n_parameters) + " parameters",
                      "as many as " + camera.model + " has");
        cameras.push_back(std::move(camera));
    });
    return cameras;
}

std::vector<ColmapImage> readColmapImagesText(const fs::path& file) {
    std::vector<ColmapImage> images;
    forEachEntry(file, "Number of images: ", [&](TextLine& line, const auto& nextLine) {
        ColmapImage image;
        image.id = line.number<std::uint32_t>("an image's id");
        for (double& value : image.rotation) value = line.number<double>("a rotation");
        image.translation = line.vector("a translation");
        image.camera = line.number<std::uint32_t>("an image's camera");
        image.name = line.remainder("a name");
        for (TextLine features = nextLine(); !features.isEmpty();) {
            const double x = features.number<double>("a feature"), y = features.number<double>("a feature");
            const auto point = features.number<std::int64_t>("a feature's point");
            if (point >= 0) image.observations.push_back({{x, y}, static_cast<std::uint64_t>(point)});
        }
        images.push_back(std::move(image));
    });
    return images;
}

std::vector<ColmapPoint> readColmapPointsText(const fs::path& file) {
    std::vector<ColmapPoint> points;
    forEachEntry(file, "Number of points: ", [&](TextLine& line, const auto&) {
        ColmapPoint point;
        point.id = line.number<std::uint64_t>("a point's id");
        point.position = line.vector("a position");
        for (int i = 0; i < 3; ++i) line.number<std::uint32_t>("a colour");
        line.number<double>("an error");
        for (; !line.isEmpty(); ++point.track_length) {
            line.number<std::uint32_t>("a track's image");
            line.number<std::uint32_t>("a track's feature");
        }
        points.push_back(point);
    });
    return points;
}

}  // namespace nerfvdb
