// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_colmap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/median.h"
#include "trainer/colmap_lens.h"
#include "trainer/posed_frames.h"
#include "trainer/scene_box.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr double kUnitTolerance = 1e-2;        // of a quaternion's length: text may be rounded
constexpr double kGoodReprojection = 4;        // pixels; mapping drops observations beyond it
constexpr std::size_t kJudgedObservations = 100'000;

/// Every folder of a model, in the order of names.
std::vector<fs::path> modelFolders(const fs::path& root) {
    std::vector<fs::path> folders;
    std::error_code unreadable;
    for (const fs::path& base : {root / "sparse", root / "colmap" / "sparse", root}) {
        if (base != root)
            for (const fs::directory_entry& entry : fs::directory_iterator(base, unreadable)) {
                const std::string name = entry.path().filename().string();
                const bool is_number = std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
                if (is_number && isColmapModel(entry.path())) folders.push_back(entry.path());
            }
        if (isColmapModel(base)) folders.push_back(base);
        if (!folders.empty()) break;
    }
    std::sort(folders.begin(), folders.end());
    return folders;
}

/// The images of the model that has the most; the first of equals.
ColmapPart<ColmapImage> imagesOfLargest(const fs::path& root, std::vector<std::string>& warnings) {
    ColmapPart<ColmapImage> largest;
    std::string counts;
    const std::vector<fs::path> folders = modelFolders(root);
    for (const fs::path& folder : folders) {
        ColmapPart<ColmapImage> images = readColmapImages(folder);
        counts += (counts.empty() ? "" : ", ") + folder.lexically_relative(root).generic_string() + " (" +
                  std::to_string(images.entries.size()) + " images)";
        if (largest.file.empty() || images.entries.size() > largest.entries.size()) largest = std::move(images);
    }
    if (largest.entries.empty())
        throw DataError(largest.file.empty() ? root.string() : largest.file.string(), "no registered image",
                        "at least one", "the mapping failed: take more photographs that overlap, and map again");
    if (folders.size() > 1)
        warnings.push_back(root.string() + ": " + std::to_string(folders.size()) + " models: " + counts + "; " +
                           largest.file.parent_path().lexically_relative(root).generic_string() +
                           " is used, with the most images");
    return largest;
}

std::string placeOf(const ColmapPart<ColmapImage>& images, const ColmapImage& image) {
    return images.file.string() + ": image " + std::to_string(image.id);
}

/// The pose, from camera_from_world with y down to world_from_camera with y up.
void setPose(const ColmapImage& image, const std::string& where, Camera& camera) {
    const auto& [w, x, y, z] = image.rotation;
    Eigen::Quaterniond rotation(w, x, y, z);
    const double length = rotation.norm();
    if (!(std::abs(length - 1) <= kUnitTolerance)) {
        const auto text = [](double value) { return std::to_string(value); };
        throw DataError(where, "the quaternion " + text(w) + " " + text(x) + " " + text(y) + " " + text(z),
                        "one of length 1", "the file is damaged: map or copy it again");
    }
    if (!image.translation.allFinite())
        throw DataError(where, "a translation that is not finite", "numbers", "the file is damaged: map or copy it again");
    rotation.normalize();
    const Mat3d world_from_colmap = rotation.toRotationMatrix().transpose();
    camera.position = -(world_from_colmap * image.translation);
    camera.world_from_camera = world_from_colmap * Vec3d(1, -1, -1).asDiagonal();
}

Camera cameraOfImage(const ColmapPart<ColmapCamera>& cameras, const ColmapPart<ColmapImage>& images,
                     const ColmapImage& image) {
    const auto source = std::lower_bound(cameras.entries.begin(), cameras.entries.end(), image.camera,
                                         [](const ColmapCamera& camera, std::uint32_t id) { return camera.id < id; });
    const std::string where = placeOf(images, image);
    if (source == cameras.entries.end() || source->id != image.camera)
        throw DataError(where, "camera " + std::to_string(image.camera), "one that " + cameras.file.string() + " has",
                        "cameras and images are of different models: copy all of one");
    const std::string lens_where = cameras.file.string() + ": camera " + std::to_string(source->id);
    Camera camera = cameraOf(*source, lens_where);
    setPose(image, where, camera);
    if (const std::string problem = cameraProblem(camera); !problem.empty())
        throw DataError(lens_where, problem, "a usable camera",
                        "map again with a simpler lens model, or crop the images to what the lens shows");
    return camera;
}

/// The named image, or one of another extension: smaller versions are often of another format.
ListedFrame findImage(const ColmapPart<ColmapImage>& images, std::size_t index, const fs::path& folder) {
    const std::string& name = images.entries[index].name;
    fs::path image;
    const auto isThere = [&](const fs::path& relative) {
        if (isFile(image = folder / relative)) return true;
        for (const char* extension : {".png", ".jpg", ".jpeg", ".exr", ".PNG", ".JPG", ".JPEG", ".EXR"})
            if (isFile(image.replace_extension(extension))) return true;
        return false;
    };
    if (placeInside(name, isThere)) return {index, name, image, true};
    const std::optional<fs::path> expected = placeExpected(name);
    if (!expected)
        throw DataError(placeOf(images, images.entries[index]), "the name '" + name + "'", "a path inside " + folder.string());
    return {index, name, folder / *expected, false};
}

/// Images that the model says nothing of were not registered: a person would want to know.
void warnOfImagesWithoutPose(const fs::path& folder, const std::vector<ListedFrame>& frames,
                             std::vector<std::string>& warnings) {
    std::set<fs::path> posed, others;
    for (const ListedFrame& frame : frames) posed.insert(frame.image);
    std::error_code unreadable;
    std::size_t n_images = 0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder, unreadable)) {
        if (!isImageName(entry.path()) || !entry.is_regular_file(unreadable)) continue;
        ++n_images;
        if (posed.count(entry.path()) == 0) others.insert(entry.path());
    }
    if (!others.empty())
        warnings.push_back(folder.string() + ": " + std::to_string(others.size()) + " of " + std::to_string(n_images) +
                           " images have no pose (first: " + others.begin()->filename().string() +
                           ") and are left out: COLMAP did not register them");
}

View viewOf(const ListedFrame& frame, const Camera& stated, const ColmapPart<ColmapImage>& images, bool& has_alpha) {
    const ImageHeader header = readImageHeader(frame.image);
    if (!isSameAspect(stated.width, stated.height, header.width, header.height))
        throw DataError(placeOf(images, images.entries[frame.index]),
                        frame.image.string() + " of " + sizeText(header.width, header.height) + " pixels",
                        sizeText(stated.width, stated.height) + " as its camera, or another size of that aspect",
                        adviceOnAspect(stated.width, stated.height, header.width, header.height));
    has_alpha |= header.has_alpha;
    View view;
    const bool is_same = header.width == stated.width && header.height == stated.height;
    view.camera = is_same ? stated : resized(stated, header.width, header.height);
    view.path = frame.image;
    return view;
}

void dropInfinitePoints(ColmapPart<ColmapPoint>& points, Dataset& dataset) {
    const Box cameras = boxOfCameras(dataset);
    const std::size_t n_all = points.entries.size();
    const std::size_t n_infinite =
        std::erase_if(points.entries, [&](const ColmapPoint& point) { return isAtInfinity(point.position, cameras); });
    if (n_infinite > 0)
        dataset.warnings.push_back(points.file.string() + ": " + leftOutAtInfinity(n_infinite, n_all));
}

std::vector<Vec3d> usefulPoints(const ColmapPart<ColmapPoint>& points) {
    std::vector<Vec3d> useful;
    for (const ColmapPoint& point : points.entries)
        if (point.track_length >= 2) useful.push_back(point.position);
    return useful;
}

/// A median of few pixels with one digit.
std::string pixelsText(double pixels) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", pixels);
    return text;
}

}  // namespace

bool hasColmap(const fs::path& folder) { return fs::is_directory(folder) && !modelFolders(folder).empty(); }

Dataset readColmap(const fs::path& folder, Split split, bool strict) {
    Dataset dataset;
    dataset.root = folder;
    const ColmapPart<ColmapImage> images = imagesOfLargest(folder, dataset.warnings);
    const fs::path model = images.file.parent_path();
    const ColmapPart<ColmapCamera> cameras = readColmapCameras(model);
    ColmapPart<ColmapPoint> points = readColmapPoints(model);

    const fs::path image_folder = findImageFolder(folder);
    std::vector<ListedFrame> frames;
    for (std::size_t i = 0; i < images.entries.size(); ++i) frames.push_back(findImage(images, i, image_folder));
    std::sort(frames.begin(), frames.end(), [](const ListedFrame& a, const ListedFrame& b) { return a.name < b.name; });
    const auto twice = std::adjacent_find(frames.begin(), frames.end(), [](const ListedFrame& a, const ListedFrame& b) {
        return a.name == b.name;
    });
    if (twice != frames.end()) throw DataError(images.file.string(), "two images named '" + twice->name + "'", "one");
    dropAbsent(frames, images.file.string(), strict, dataset.warnings);
    warnOfMoved(frames, images.file.string(), dataset.warnings);
    warnOfSharedImages(frames, images.file.string(), dataset.warnings);
    warnOfImagesWithoutPose(image_folder, frames, dataset.warnings);

    const std::size_t n_listed = frames.size();
    frames = everyEighthHeldOut(frames, split);
    if (frames.empty())
        throw DataError(images.file.string(),
                        "no frame for the " + std::string(nameOf(split)) + " split (" + std::to_string(n_listed) + " listed)",
                        "at least one");
    for (const ListedFrame& frame : frames) {
        const Camera stated = cameraOfImage(cameras, images, images.entries[frame.index]);
        dataset.views.push_back(viewOf(frame, stated, images, dataset.has_alpha));
    }
    dropInfinitePoints(points, dataset);
    dataset.points = usefulPoints(points);
    if (const auto error = reprojectionError(cameras, images, points); error && !(*error < kGoodReprojection))
        dataset.warnings.push_back(model.string() + ": its points are " + pixelsText(*error) +
                                   " pixels (median) from where its images show them: cameras, images and points are "
                                   "not of one model, or damaged");
    return dataset;
}

std::optional<double> reprojectionError(const ColmapPart<ColmapCamera>& cameras, const ColmapPart<ColmapImage>& images,
                                        const ColmapPart<ColmapPoint>& points) {
    std::size_t n_observations = 0;
    for (const ColmapImage& image : images.entries) n_observations += image.observations.size();
    const std::size_t stride = n_observations / kJudgedObservations + 1;

    std::vector<double> errors;
    std::size_t skip = 0;  // observations until the next that is judged
    for (const ColmapImage& image : images.entries) {
        if (skip >= image.observations.size()) {
            skip -= image.observations.size();
            continue;
        }
        const Camera camera = cameraOfImage(cameras, images, image);
        std::size_t i = skip;
        for (; i < image.observations.size(); i += stride) {
            const ColmapObservation& seen = image.observations[i];
            const auto point = std::lower_bound(points.entries.begin(), points.entries.end(), seen.point,
                                                [](const ColmapPoint& p, std::uint64_t id) { return p.id < id; });
            if (point == points.entries.end() || point->id != seen.point) continue;
            const std::optional<Vec2d> pixel = projectPoint(camera, point->position);
            const double error = pixel ? (*pixel - seen.pixel).norm() : HUGE_VAL;
            errors.push_back(std::isfinite(error) ? error : HUGE_VAL);
        }
        skip = i - image.observations.size();
    }
    if (errors.empty()) return std::nullopt;
    return medianOf(std::move(errors));
}

}  // namespace nerfvdb
