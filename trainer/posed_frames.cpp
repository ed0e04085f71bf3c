// SPDX-License-Identifier: Apache-2.0
#include "trainer/posed_frames.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>

#include "core/error.h"

namespace nerfvdb {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHoldOutEvery = 8;

}  // namespace

const char* nameOf(Split split) {
    switch (split) {
        case Split::train:
            return "train";
        case Split::val:
            return "val";
        case Split::test:
            return "test";
    }
    return "";
}

std::optional<fs::path> pathInside(const std::string& name) {
    const fs::path path = fs::path(name).lexically_normal();
    if (path.empty() || path.is_absolute() || *path.begin() == ".." || name.find('\0') != name.npos) return std::nullopt;
    return path;
}

namespace {

std::string slashed(std::string name) {
    std::replace(name.begin(), name.end(), '\\', '/');
    return name;
}

}  // namespace

bool leadsOut(const std::string& name) {
    const std::string path = slashed(name);
    const bool has_drive = path.size() > 2 && path[1] == ':' && path[2] == '/';
    return has_drive || !pathInside(path);
}

std::optional<fs::path> placeExpected(const std::string& name) {
    const std::string path = slashed(name);
    return pathInside(leadsOut(name) ? fs::path(path).filename().string() : path);
}

std::optional<fs::path> placeInside(const std::string& name, const std::function<bool(const fs::path&)>& is_there) {
    if (const std::optional<fs::path> as_named = pathInside(name); as_named && is_there(*as_named)) return as_named;
    if (!leadsOut(name)) {
        const std::optional<fs::path> relative = placeExpected(name);
        return relative && is_there(*relative) ? relative : std::nullopt;
    }
    const fs::path whole = fs::path(slashed(name)).lexically_normal();
    for (auto first = whole.begin(); first != whole.end(); ++first) {
        fs::path end;
        for (auto part = first; part != whole.end(); ++part) end /= *part;
        if (const std::optional<fs::path> relative = pathInside(end.string()); relative && is_there(*relative)) return relative;
    }
    return std::nullopt;
}

bool isFile(const fs::path& path) {
    std::error_code too_long_or_forbidden;
    return fs::is_regular_file(path, too_long_or_forbidden);
}

bool isImageName(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension == ".png" || extension == ".jpg" || extension == ".jpeg" || extension == ".exr";
}

fs::path findImageFolder(const fs::path& root) {
    for (const char* name : {"images", "images_2", "images_4", "images_8"})
        if (fs::is_directory(root / name)) return root / name;
    throw DataError(root.string(), "no folder 'images', 'images_2', 'images_4' or 'images_8'", "the posed photographs",
                    "lay them there, or link to them");
}

void warnOfMoved(const std::vector<ListedFrame>& frames, const std::string& where, std::vector<std::string>& warnings) {
    const auto isMoved = [](const ListedFrame& frame) { return frame.has_image && leadsOut(frame.name); };
    const auto first = std::find_if(frames.begin(), frames.end(), isMoved);
    if (first == frames.end()) return;
    warnings.push_back(where + ": " + std::to_string(std::count_if(frames.begin(), frames.end(), isMoved)) + " of " +
                       std::to_string(frames.size()) +
                       " paths lead out of the data folder; images of their names in it are taken (" + first->image.string() +
                       " for " + first->name + ")");
}

void warnOfSharedImages(const std::vector<ListedFrame>& frames, const std::string& where, std::vector<std::string>& warnings) {
    std::map<fs::path, std::size_t> counts;
    for (const ListedFrame& frame : frames) ++counts[frame.image];
    const std::size_t n = frames.size() - counts.size();
    if (n == 0) return;
    const auto shared = std::find_if(counts.begin(), counts.end(), [](const auto& image) { return image.second > 1; });
    warnings.push_back(where + ": " + std::to_string(n) + " of " + std::to_string(frames.size()) +
                       " frames name an image that another frame has, too (first: " + shared->first.string() +
                       "): no photograph has two poses");
}

void dropAbsent(std::vector<ListedFrame>& frames, const std::string& where, bool strict,
                std::vector<std::string>& warnings) {
    const std::size_t n_listed = frames.size();
    const auto first_absent =
        std::find_if(frames.begin(), frames.end(), [](const ListedFrame& frame) { return !frame.has_image; });
    if (first_absent == frames.end()) return;
    const std::string example = first_absent->image.string() +
                                (!leadsOut(first_absent->name) ? "" : ", for " + first_absent->name + ", which leads out of the data folder");
    std::erase_if(frames, [](const ListedFrame& frame) { return !frame.has_image; });

    const std::string absent = std::to_string(n_listed - frames.size()) + " of " + std::to_string(n_listed) +
                               " frames without an image (first: " + example + ")";
    if (strict) throw DataError(where, absent, "an image for every frame", "add them or leave out --strict");
    if (2 * frames.size() < n_listed)
        throw DataError(where, absent, "at least half of the images", "lay them there, or correct what the list names");
    warnings.push_back(where + ": " + absent + " are left out");
}

std::vector<ListedFrame> everyEighthHeldOut(const std::vector<ListedFrame>& frames, Split split) {
    std::vector<ListedFrame> selected;
    for (std::size_t i = 0; i < frames.size(); ++i)
        if ((i % kHoldOutEvery == 0) == (split != Split::train)) selected.push_back(frames[i]);
    return selected;
}

bool isSameAspect(double w, double h, int width, int height) {
    // A smaller version is rounded to whole pixels; by how much depends on who rounds.
    const double tolerance = std::max(1.0, width / w);
    return std::abs(height - h * width / w) <= tolerance || std::abs(width - w * height / h) <= tolerance;
}

const char* adviceOnAspect(double w, double h, int width, int height) {
    return isSameAspect(h, w, width, height)
               ? "the image lies on its side, as EXIF may say, which is not looked at: turn its pixels as those that were posed"
               : "use the images that were posed";
}

std::string sizeText(double width, double height) {
    const auto text = [](double v) {
        if (v == std::round(v) && std::abs(v) < 1e15) return std::to_string(std::llround(v));
        std::ostringstream written;
        written << v;
        return written.str();
    };
    return text(width) + "x" + text(height);
}

Mat3d nearestRotation(Mat3d rotation) {
    for (int i = 0; i < 4; ++i)
        rotation = 0.5 * rotation * (3 * Mat3d::Identity() - rotation.transpose() * rotation);
    return rotation;
}

}  // namespace nerfvdb
