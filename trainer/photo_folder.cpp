// SPDX-License-Identifier: Apache-2.0
#include "trainer/photo_folder.h"

#include <algorithm>
#include <cctype>

#include "core/child_process.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFewestPhotos = 3;

std::string lowerExtension(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

bool isOneOf(const std::string& word, std::initializer_list<const char*> words) {
    return std::any_of(words.begin(), words.end(), [&](const char* other) { return word == other; });
}

bool isPhoto(const fs::path& path) { return isOneOf(lowerExtension(path), {".jpg", ".jpeg", ".png"}); }

bool isVideo(const fs::path& path) {
    return isOneOf(lowerExtension(path),
                   {".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mts", ".m2ts", ".mpg", ".mpeg", ".3gp"});
}

/// A word for a shell, whatever is in it.
std::string quoted(const std::string& word) {
    std::string text = "'";
    for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return text + "'";
}

[[noreturn]] void refuseVideo(const fs::path& video) {
    const std::string install = findProgram("ffmpeg") ? "" : "sudo apt install ffmpeg && ";
    throw DataError(video.string(), "a video", "photographs",
                    "two frames a second: " + install + "mkdir frames && ffmpeg -i " + quoted(video.string()) +
                        " -vf fps=2 -q:v 2 frames/%05d.jpg");
}

bool isSameFile(const fs::path& a, const fs::path& b) {
    std::error_code ignored;
    return fs::equivalent(a, b, ignored);
}

bool isUnchangedCopy(const fs::path& from, const fs::path& to) {
    return fs::file_size(from) == fs::file_size(to) && fs::last_write_time(from) <= fs::last_write_time(to);
}

}  // namespace

std::vector<std::string> listPhotos(const fs::path& folder, Report& report) {
    if (!fs::exists(folder))
        throw IoError(folder.string(), "no such file or folder", "a folder of photographs", "check the name");
    if (fs::is_regular_file(folder)) {
        if (isVideo(folder)) refuseVideo(folder);
        throw DataError(folder.string(), "a file", "a folder of photographs", "name the folder");
    }

    std::vector<std::string> photos, others;
    fs::path video;
    for (auto entry = fs::recursive_directory_iterator(folder); entry != fs::recursive_directory_iterator(); ++entry) {
        const fs::path relative = entry->path().lexically_relative(folder);
        const bool is_hidden = relative.filename().string().starts_with('.');
        if (is_hidden && entry->is_directory()) entry.disable_recursion_pending();
        if (is_hidden || !entry->is_regular_file()) continue;
        if (isPhoto(relative))
            photos.push_back(relative.generic_string());
        else
            others.push_back(relative.generic_string());
        if (isVideo(relative)) video = entry->path();
    }
    std::sort(photos.begin(), photos.end());
    std::sort(others.begin(), others.end());
    if (photos.empty() && !video.empty()) refuseVideo(video);
    if (photos.size() < kFewestPhotos)
        throw DataError(folder.string(), std::to_string(photos.size()) + " photographs (.jpg, .png)" +
                                             (others.empty() ? "" : " beside " + others.front()),
                        "at least " + std::to_string(kFewestPhotos) + ", better 20 or more",
                        "convert other formats to JPEG first");
    if (!others.empty())
        report.warn(folder.string() + ": " + std::to_string(others.size()) + " files are no photographs of a kind " +
                    "that is read (.jpg, .png): " + others.front() + (others.size() > 1 ? ", ..." : ""));
    return photos;
}

void placePhotos(const fs::path& folder, const std::vector<std::string>& names, const fs::path& target,
                 Report& report) {
    fs::create_directories(target);
    if (isSameFile(folder, target)) return;
    report.begin("photographs", static_cast<std::int64_t>(names.size()));
    bool copies = false;
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (report.cancelled()) throw Interrupted("stopped while photographs were laid into " + target.string());
        // A link to a symbolic link would break with it.
        const fs::path from = fs::canonical(folder / names[i]), to = target / names[i];
        if (!isSameFile(from, to) && !(fs::exists(to) && isUnchangedCopy(from, to))) {
            fs::create_directories(to.parent_path());
            fs::remove(to);
            std::error_code no_link;
            fs::create_hard_link(from, to, no_link);
            if (no_link) fs::copy_file(from, to, fs::copy_options::overwrite_existing);
            copies |= static_cast<bool>(no_link);
        }
        report.update(static_cast<std::int64_t>(i + 1), copies ? "copied" : "linked");
    }
    report.end();
}

}  // namespace nerfvdb
