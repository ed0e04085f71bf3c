// SPDX-License-Identifier: Apache-2.0
#include "trainer/colmap_model.h"

#include <algorithm>

#include "core/error.h"
#include "trainer/colmap_binary.h"
#include "trainer/colmap_text.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

template <typename T>
ColmapPart<T> readPart(const fs::path& folder, const std::string& name, std::vector<T> (*binary)(const fs::path&),
                       std::vector<T> (*text)(const fs::path&)) {
    const fs::path binary_file = folder / (name + ".bin"), text_file = folder / (name + ".txt");
    const bool is_binary = fs::exists(binary_file);
    if (!is_binary && !fs::exists(text_file))
        throw DataError(folder.string(), "neither " + name + ".bin nor " + name + ".txt", "one of them",
                        "a COLMAP model has cameras, images and points3D: copy all of it");
    ColmapPart<T> part;
    part.file = is_binary ? binary_file : text_file;
    part.entries = is_binary ? binary(part.file) : text(part.file);

    std::sort(part.entries.begin(), part.entries.end(), [](const T& a, const T& b) { return a.id < b.id; });
    const auto twice = std::adjacent_find(part.entries.begin(), part.entries.end(),
                                          [](const T& a, const T& b) { return a.id == b.id; });
    if (twice != part.entries.end())
        throw DataError(part.file.string(), "two entries with the id " + std::to_string(twice->id), "one of each");
    return part;
}

}  // namespace

bool isColmapModel(const fs::path& folder) {
    for (const char* name : {"cameras.bin", "cameras.txt", "images.bin", "images.txt"})
        if (fs::exists(folder / name)) return true;
    return false;
}

ColmapPart<ColmapCamera> readColmapCameras(const fs::path& folder) {
    return readPart(folder, "cameras", readColmapCamerasBinary, readColmapCamerasText);
}

ColmapPart<ColmapImage> readColmapImages(const fs::path& folder) {
    return readPart(folder, "images", readColmapImagesBinary, readColmapImagesText);
}

ColmapPart<ColmapPoint> readColmapPoints(const fs::path& folder) {
    return readPart(folder, "points3D", readColmapPointsBinary, readColmapPointsText);
}

}  // namespace nerfvdb
