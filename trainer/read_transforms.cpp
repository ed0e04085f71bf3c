// SPDX-License-Identifier: Apache-2.0
#include "trainer/read_transforms.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "trainer/json_node.h"
#include "trainer/ply_points.h"
#include "trainer/posed_frames.h"
#include "trainer/scene_box.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxSide = 1 << 20;  // pixels

fs::path splitFile(const fs::path& folder, Split split) {
    return folder / (std::string("transforms_") + nameOf(split) + ".json");
}

/// The JSON file that a split comes from. A folder with split files has one per split.
struct Source {
    fs::path file;
    bool is_split_file = false;
};

/// A file of one split stands for the folder that holds it and the others.
fs::path withoutSplitFile(const fs::path& path) {
    for (const Split split : {Split::train, Split::val, Split::test})
        if (path.filename() == splitFile({}, split))
            return path.has_parent_path() ? path.parent_path() : fs::path(".");
    return path;
}

Source findSource(const fs::path& named, Split split, std::vector<std::string>& warnings) {
    if (!fs::exists(named))
        throw IoError(named.string(), "no such file or folder", "a data set", "check the name");
    const fs::path path = withoutSplitFile(named);
    if (!fs::is_directory(path)) return {path, false};
    if (fs::exists(splitFile(path, split))) return {splitFile(path, split), true};
    if (split == Split::val && fs::exists(splitFile(path, Split::test))) {
        warnings.push_back(path.string() + ": no transforms_val.json; the test split serves instead");
        return {splitFile(path, Split::test), true};
    }
    if (fs::exists(path / "transforms.json")) return {path / "transforms.json", false};

    std::string present;
    for (const Split other : {Split::train, Split::val, Split::test})
        if (fs::exists(splitFile(path, other)))
            present += std::string(present.empty() ? "" : ", ") + nameOf(other);
    if (present.empty())
        throw DataError(path.string(), "no transforms.json and no transforms_train.json", "one of them",
                        "name the folder that holds it");
    throw DataError(path.string(), "no " + std::string(nameOf(split)) + " split (only " + present + ")",
                    "transforms_" + std::string(nameOf(split)) + ".json", "choose another split");
}

constexpr const char* kNoPlace = "correct it, or put the file into the data folder";

/// The named file, or the same with an extension that the JSON left out.
ListedFrame findImage(const JsonNode& frame, std::size_t index, const fs::path& folder) {
    const JsonNode node = frame.at("file_path");
    const std::string file_path = node.text();
    fs::path image;
    const auto isThere = [&](const fs::path& relative) {
        for (const char* extension : {"", ".png", ".jpg", ".jpeg", ".exr", ".PNG", ".JPG", ".JPEG", ".EXR"}) {
            image = folder / relative;
            image += extension;
            if (isFile(image)) return true;
        }
        return false;
    };
    if (placeInside(file_path, isThere)) return {index, file_path, image, true};
    const std::optional<fs::path> relative = placeExpected(file_path);
    if (!relative) node.fail("'" + file_path + "'", "a path inside the data folder", kNoPlace);
    fs::path expected = folder / *relative;
    if (!expected.has_extension()) expected += ".png";
    return {index, file_path, expected, false};
}

/// The frames that a list such as nerfstudio's "train_filenames" names.
std::vector<ListedFrame> selectNamed(const std::vector<ListedFrame>& frames, const JsonNode& names) {
    std::set<std::string> wanted;
    for (std::size_t i = 0; i < names.arraySize(); ++i) wanted.insert(names.element(i).text());
    std::vector<ListedFrame> selected;
    std::copy_if(frames.begin(), frames.end(), std::back_inserter(selected),
                 [&](const ListedFrame& frame) { return wanted.count(frame.name) > 0; });
    return selected;
}

std::vector<ListedFrame> selectSplit(const std::vector<ListedFrame>& frames, const JsonNode& document, Split split,
                                     std::vector<std::string>& warnings, const fs::path& file) {
    const bool has_lists = document.has("train_filenames") || document.has("test_filenames");
    if (has_lists) {
        std::string key = std::string(nameOf(split)) + "_filenames";
        if (split == Split::val && !document.has(key.c_str())) {
            warnings.push_back(file.string() + ": no val_filenames; the test split serves instead");
            key = "test_filenames";
        }
        return selectNamed(frames, document.at(key.c_str()));
    }
    return everyEighthHeldOut(frames, split);
}

/// What a file or a frame says about the lens; a frame's words go over the file's.
struct Lens {
    std::optional<double> w, h, fl_x, fl_y, cx, cy, angle_x, angle_y;
    Distortion distortion;
    bool is_rational = false;  // says FULL_OPENCV
};

void readLensModel(const JsonNode& node, Lens& lens) {
    if (node.has("camera_model")) {
        const std::string model = node.at("camera_model").text();
        static const std::set<std::string> kPerspective{"OPENCV",        "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE",
                                                        "SIMPLE_RADIAL", "RADIAL",  "FULL_OPENCV"};
        static const std::set<std::string> kFisheye{"OPENCV_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"};
        if (kPerspective.count(model) + kFisheye.count(model) == 0)
            node.at("camera_model")
                .fail("'" + model + "'", "PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE", "undistort the images first");
        lens.distortion.model = kFisheye.count(model) > 0 ? LensModel::fisheye : LensModel::perspective;
        lens.is_rational = model == "FULL_OPENCV";
    }
    if (node.has("is_fisheye") && node.at("is_fisheye").isTrue()) lens.distortion.model = LensModel::fisheye;
}

/// What only file and frame together can get wrong.
void checkLens(const JsonNode& frame, const Lens& lens) {
    const Distortion& d = lens.distortion;
    const bool is_fisheye = d.model == LensModel::fisheye;
    if (!is_fisheye && d.k4 != 0 && d.k5 == 0 && d.k6 == 0 && !lens.is_rational)
        frame.fail("k4 of " + std::to_string(d.k4) + " without a camera_model that has it",
                   "FULL_OPENCV (a denominator's r^2) or OPENCV_FISHEYE (theta^9)",
                   "name the model; where k4 is meant for r^8, as nerfstudio has it, undistort the images first");
    if (is_fisheye && !lens.fl_x && !lens.fl_y)
        frame.fail("a fisheye lens without fl_x", "its focal length in pixels");
}

Lens readLens(const JsonNode& node, Lens lens) {
    readLensModel(node, lens);
    const auto read = [&](const char* key, std::optional<double>& value) {
        if (node.has(key)) value = node.at(key).number();
    };
    const auto readPositive = [&](const char* key, std::optional<double>& value) {
        if (node.has(key)) value = node.at(key).positiveNumber();
    };
    const auto readAngle = [&](const char* key, std::optional<double>& value, std::optional<double>& focal) {
        if (!node.has(key)) return;
        value = node.at(key).positiveNumber();
        if (*value >= M_PI) node.at(key).fail(std::to_string(*value), "an angle below pi, in radians");
        focal.reset();  // a frame's angle also overrides the file's focal length
    };
    readAngle("camera_angle_x", lens.angle_x, lens.fl_x);
    readAngle("camera_angle_y", lens.angle_y, lens.fl_y);
    readPositive("fl_x", lens.fl_x);
    readPositive("fl_y", lens.fl_y);
    for (const auto& [key, side] : {std::pair{"w", &lens.w}, std::pair{"h", &lens.h}}) {
        readPositive(key, *side);
        if (*side && **side > kMaxSide) node.at(key).fail(std::to_string(**side), "pixels, at most 2^20");
    }
    read("cx", lens.cx);
    read("cy", lens.cy);

    Distortion& d = lens.distortion;
    const std::pair<const char*, double*> terms[] = {
        {"k1", &d.k1}, {"k2", &d.k2}, {"k3", &d.k3}, {"k4", &d.k4},
        {"k5", &d.k5}, {"k6", &d.k6}, {"p1", &d.p1}, {"p2", &d.p2}};
    for (const auto& [key, value] : terms)
        if (node.has(key)) *value = node.at(key).number();
    return lens;
}

/// Intrinsics for the image at hand. The numbers belong to the w x h that the JSON states.
Camera intrinsics(const Lens& lens, const JsonNode& frame, const ListedFrame& source, const ImageHeader& image) {
    const int width = image.width, height = image.height;
    const double w = lens.w.value_or(lens.h ? *lens.h * width / height : width);
    const double h = lens.h.value_or(w * height / width);
    if (!isSameAspect(w, h, width, height))
        frame.at("file_path")
            .fail(source.image.string() + " of " + sizeText(width, height) + " pixels",
                  sizeText(w, h) + " (w, h) or another size of that aspect", adviceOnAspect(w, h, width, height));

    const auto focalFromAngle = [](double size, double angle) { return 0.5 * size / std::tan(0.5 * angle); };
    std::optional<double> fx = lens.fl_x, fy = lens.fl_y;
    if (!fx && lens.angle_x) fx = focalFromAngle(w, *lens.angle_x);
    if (!fy && lens.angle_y) fy = focalFromAngle(h, *lens.angle_y);
    if (!fx && !fy) frame.fail("no focal length", "fl_x or camera_angle_x, here or for the whole file");

    Camera camera;
    camera.width = static_cast<int>(std::lround(w));
    camera.height = static_cast<int>(std::lround(h));
    camera.fx = fx.value_or(fy.value_or(0));
    camera.fy = fy.value_or(camera.fx);
    camera.cx = lens.cx.value_or(0.5 * w);
    camera.cy = lens.cy.value_or(0.5 * h);
    camera.distortion = lens.distortion;
    return width == camera.width && height == camera.height ? camera : resized(camera, width, height);
}

/// Rotation and position from the upper 3x4 of a row-major 4x4.
void readPose(const JsonNode& matrix, Camera& camera) {
    const std::size_t n_rows = matrix.arraySize();
    if (n_rows != 3 && n_rows != 4) matrix.fail(std::to_string(n_rows) + " rows", "3 or 4");
    for (std::size_t row = 0; row < n_rows; ++row) {
        if (matrix.element(row).arraySize() != 4)
            matrix.element(row).fail(std::to_string(matrix.element(row).arraySize()) + " numbers", "4");
        for (std::size_t column = 0; column < 4; ++column) {
            const double value = matrix.element(row).element(column).number();
            const auto r = static_cast<Eigen::Index>(row), c = static_cast<Eigen::Index>(column);
            if (row == 3 &&
                std::abs(value - (column == 3)) > 1e-6)  // exact in every writer; a projective row is not
                matrix.element(row).fail("a last row other than 0 0 0 1", "a rigid pose");
            if (row < 3 && column < 3) camera.world_from_camera(r, c) = value;
            if (row < 3 && column == 3) camera.position(r) = value;
        }
    }
}

Camera readCamera(const JsonNode& frame, const Lens& file_lens, const ListedFrame& source, const ImageHeader& image,
                  bool check_pose) {
    const Lens lens = readLens(frame, file_lens);
    checkLens(frame, lens);
    Camera camera = intrinsics(lens, frame, source, image);
    readPose(frame.at("transform_matrix"), camera);
    const std::string problem = cameraProblem(camera);
    if (!problem.empty() && !check_pose) return camera;
    if (!problem.empty())
        (problem.find("pose") != std::string::npos ? frame.at("transform_matrix") : frame)
            .fail(problem, "a usable camera (rigid pose, camera to world)");
    camera.world_from_camera = nearestRotation(camera.world_from_camera);
    return camera;
}

/// Where a frame's mask lies, or nothing. One that is named and absent would let in what it was to hide. No photograph is its
/// own mask.
fs::path namedMask(const JsonNode& frame, const fs::path& folder, const fs::path& image) {
    if (!frame.has("mask_path")) return {};
    const JsonNode node = frame.at("mask_path");
    const std::string name = node.text();
    const auto isMask = [&](const fs::path& place) { return folder / place != image && isFile(folder / place); };
    if (const auto relative = placeInside(name, isMask))
        return folder / *relative;
    const std::optional<fs::path> relative = pathInside(name);
    if (!relative) node.fail("'" + name + "'", "a path inside the data folder", kNoPlace);
    node.fail("no file " + (folder / *relative).string(), "the frame's mask", "add it, or remove the key");
}

/// The sparse points that nerfstudio lays beside its list, if they are there.
std::vector<Vec3d> sparsePoints(const JsonNode& node, const fs::path& file, Dataset& dataset) {
    const std::string name = node.text();
    const fs::path folder = file.parent_path();
    const auto relative = placeInside(name, [&](const fs::path& path) { return isFile(folder / path); });
    const auto warn = [&](const std::string& what) { dataset.warnings.push_back(file.string() + ": ply_file_path: " + what); };
    if (!relative) {
        warn("no file " + name + " in the data folder; training finds out by itself where voxels are needed");
        return {};
    }
    try {
        std::vector<Vec3d> points = readPlyPoints(folder / *relative);
        const std::size_t n_all = points.size();
        const Box cameras = boxOfCameras(dataset);
        const auto n = std::erase_if(points, [&](const Vec3d& point) { return isAtInfinity(point, cameras); });
        if (n > 0) warn(leftOutAtInfinity(n, n_all));
        return points;
    } catch (const Error& error) {
        warn(std::string(error.what()) + "; training goes on without the points");
        return {};
    }
}

/// Whether a camera moves while the photograph is taken, as instant-ngp has it.
bool isMoving(const JsonNode& node) {
    if (node.has("transform_matrix_start") || node.has("transform_matrix_end")) return true;
    if (!node.has("rolling_shutter")) return false;
    const JsonNode shutter = node.at("rolling_shutter");
    for (std::size_t i = 0; i < shutter.arraySize(); ++i)
        if (shutter.element(i).number() != 0) return true;
    return false;
}

/// What other programs write, and this one does not use, is said where it is to be learned from.
void warnOfUnused(const JsonNode& document, const std::vector<ListedFrame>& frames, const fs::path& file,
                  std::vector<std::string>& warnings) {
    const JsonNode list = document.at("frames");
    const auto count = [&](const auto& has) {
        return std::count_if(frames.begin(), frames.end(),
                             [&](const ListedFrame& frame) { return has(list.element(frame.index)); });
    };
    const auto warn = [&](std::ptrdiff_t n, const std::string& what) {
        if (n > 0)
            warnings.push_back(file.string() + ": " + std::to_string(n) + " of " + std::to_string(frames.size()) + " frames " +
                               what);
    };
    warn(count([](const JsonNode& frame) { return frame.has("depth_file_path") || frame.has("depth_path"); }),
         "name depth maps, which are not used: depth is learned from the photographs alone");
    const bool all_move = isMoving(document);
    warn(count([&](const JsonNode& frame) { return all_move || isMoving(frame); }),
         "were taken by a moving camera (rolling_shutter, transform_matrix_start or _end), which is not modelled: each is taken to "
         "be of one moment, from its transform_matrix");
}

}  // namespace

bool hasTransforms(const fs::path& path) {
    if (!fs::is_directory(path)) return path.extension() == ".json";
    return fs::exists(path / "transforms.json") || fs::exists(splitFile(path, Split::train)) ||
           fs::exists(splitFile(path, Split::val)) || fs::exists(splitFile(path, Split::test));
}

Dataset readTransforms(const fs::path& path, Split split, bool strict, bool check_poses) {
    Dataset dataset;
    dataset.root = path;
    const Source source = findSource(path, split, dataset.warnings);
    const nlohmann::json json = parseJsonFile(source.file);
    const JsonNode document(json, source.file);
    if (document.has("aabb_scale")) dataset.aabb_scale = document.at("aabb_scale").positiveNumber();
    const Lens lens = readLens(document, {});

    const JsonNode list = document.at("frames");
    std::vector<ListedFrame> frames;
    for (std::size_t i = 0; i < list.arraySize(); ++i)
        frames.push_back(findImage(list.element(i), i, source.file.parent_path()));

    warnOfMoved(frames, source.file.string(), dataset.warnings);
    // Absent images go first, so that every 8th is counted among those that exist.
    dropAbsent(frames, source.file.string() + ": frames", strict, dataset.warnings);
    warnOfSharedImages(frames, source.file.string(), dataset.warnings);
    if (!source.is_split_file) {
        std::stable_sort(frames.begin(), frames.end(),
                         [](const ListedFrame& a, const ListedFrame& b) { return a.name < b.name; });
        frames = selectSplit(frames, document, split, dataset.warnings, source.file);
    }
    if (frames.empty())
        list.fail("no frame for the " + std::string(nameOf(split)) + " split (" +
                      std::to_string(list.arraySize()) + " listed)",
                  "at least one");

    if (split == Split::train) warnOfUnused(document, frames, source.file, dataset.warnings);
    for (const ListedFrame& frame : frames) {
        const ImageHeader image = readImageHeader(frame.image);
        dataset.has_alpha |= image.has_alpha;
        const JsonNode node = list.element(frame.index);
        View view;
        view.camera = readCamera(node, lens, frame, image, check_poses);
        view.path = frame.image;
        view.mask_path = namedMask(node, source.file.parent_path(), view.path);
        dataset.views.push_back(std::move(view));
    }
    if (split == Split::train && document.has("ply_file_path")) dataset.points = sparsePoints(document.at("ply_file_path"), source.file, dataset);
    return dataset;
}

}  // namespace nerfvdb
