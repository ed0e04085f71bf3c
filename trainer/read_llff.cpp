// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_llff.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "trainer/npy_file.h"
#include "trainer/posed_frames.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRowNumbers = 17;
constexpr double kMaxSide = 1 << 20;  // pixels
constexpr const char* kFileName = "poses_bounds.npy";

std::vector<fs::path> imagesIn(const fs::path& folder) {
    std::vector<fs::path> images;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
        if (entry.is_regular_file() && isImageName(entry.path()) && !entry.path().filename().string().starts_with("."))
            images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    return images;
}

View viewOf(const NpyMatrix& rows, std::size_t row, const fs::path& image, const std::string& where, bool& has_alpha) {
    const auto entry = [&](int r, int c) { return rows.at(row, static_cast<std::size_t>(5 * r + c)); };
    const double height = entry(0, 4), width = entry(1, 4), focal = entry(2, 4);
    const auto isSize = [](double v) { return v >= 1 && v <= kMaxSide && v == std::round(v); };
    if (!isSize(width) || !isSize(height))
        throw DataError(where, "images of " + std::to_string(width) + "x" + std::to_string(height), "whole pixels");
    const ImageHeader header = readImageHeader(image);
    if (!isSameAspect(width, height, header.width, header.height))
        throw DataError(where, image.string() + " of " + sizeText(header.width, header.height) + " pixels",
                        sizeText(width, height) + " or another size of that aspect",
                        adviceOnAspect(width, height, header.width, header.height));
    has_alpha |= header.has_alpha;

    Camera camera;
    camera.width = static_cast<int>(width);
    camera.height = static_cast<int>(height);
    camera.fx = camera.fy = focal;
    camera.cx = 0.5 * width;
    camera.cy = 0.5 * height;
    for (int r = 0; r < 3; ++r) {
        camera.world_from_camera.row(r) << entry(r, 1), -entry(r, 0), entry(r, 2);  // right, up, backward
        camera.position[r] = entry(r, 3);
    }
    if (const std::string problem = cameraProblem(camera); !problem.empty())
        throw DataError(where, problem, "a usable camera (axes down, right, backward)");
    camera.world_from_camera = nearestRotation(camera.world_from_camera);

    View view;
    const bool is_same = header.width == camera.width && header.height == camera.height;
    view.camera = is_same ? camera : resized(camera, header.width, header.height);
    view.path = image;
    const DepthRange range{rows.at(row, 15), rows.at(row, 16)};
    if (range.near > 0 && range.near < range.far && std::isfinite(range.far)) view.depth_range = range;
    return view;
}

}  // namespace

bool hasLlff(const fs::path& folder) { return fs::is_directory(folder) && fs::exists(folder / kFileName); }

Dataset readLlff(const fs::path& folder, Split split) {
    Dataset dataset;
    dataset.root = folder;
    const fs::path file = folder / kFileName;
    const NpyMatrix rows = readNpyMatrix(file);
    if (rows.columns != kRowNumbers)
        throw DataError(file.string(), "rows of " + std::to_string(rows.columns) + " numbers",
                        std::to_string(kRowNumbers) + ": a pose of 3x5 and two depths");
    const fs::path image_folder = findImageFolder(folder);
    const std::vector<fs::path> images = imagesIn(image_folder);
    if (images.size() != rows.rows)
        throw DataError(file.string(),
                        std::to_string(rows.rows) + " poses for " + std::to_string(images.size()) + " images in " +
                            image_folder.string(),
                        "as many", "poses go by the order of names: use exactly the images that were posed");

    std::vector<ListedFrame> frames;
    for (std::size_t i = 0; i < images.size(); ++i) frames.push_back({i, images[i].filename().string(), images[i], true});
    frames = everyEighthHeldOut(frames, split);
    if (frames.empty())
        throw DataError(file.string(),
                        "no frame for the " + std::string(nameOf(split)) + " split (" + std::to_string(images.size()) +
                            " listed)",
                        "at least one");
    std::size_t n_without_range = 0;
    for (const ListedFrame& frame : frames) {
        const std::string where = file.string() + ": row " + std::to_string(frame.index);
        dataset.views.push_back(viewOf(rows, frame.index, frame.image, where, dataset.has_alpha));
        n_without_range += !dataset.views.back().depth_range;
    }
    if (n_without_range > 0)
        dataset.warnings.push_back(file.string() + ": " + std::to_string(n_without_range) +
                                   " rows have no depths 0 < near < far: theirs are not used");
    return dataset;
}

}  // namespace nerfvdb
