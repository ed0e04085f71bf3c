// SPDX-License-Identifier: Apache-2.0
#include "trainer/dataset.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <memory>

#include "core/error.h"
#include "core/parallel.h"
#include "core/photo_cache.h"
#include "trainer/downscale.h"
#include "trainer/mask.h"
#include "trainer/read_colmap.h"
#include "trainer/read_llff.h"
#include "trainer/read_transforms.h"
#include "trainer/stray_cameras.h"

namespace nerfvdb {
namespace {

constexpr double kInstantNgpScale = 0.33;  // its unit cube is the world scaled by this, about (0.5, 0.5, 0.5)

/// Cameras that all stand in one point see no depth: nothing could be learned, and the error would be obscure.
void checkPositionsDiffer(const Dataset& dataset) {
    if (dataset.views.size() < 2) return;
    const Vec3d first = dataset.views[0].camera.position;
    double spread = 0, magnitude = 0;
    for (const View& view : dataset.views) {
        spread = std::max(spread, (view.camera.position - first).norm());
        magnitude = std::max(magnitude, view.camera.position.norm());
    }
    // Five metres in map coordinates of 5e6 m are a scene. A double's rounding, through a rotation or two, is not.
    if (spread <= 1e-12 * magnitude)
        throw DataError(dataset.root.string() + ": camera positions",
                        "all " + std::to_string(dataset.views.size()) + " cameras in one point",
                        "cameras that look from different places",
                        "check the poses (in a transform_matrix, the last column)");
}

/// Finds the masks that the data set does not name.
void findMasks(Dataset& dataset, const std::filesystem::path& folder, bool warns) {
    for (View& view : dataset.views)
        if (view.mask_path.empty()) view.mask_path = findMask(view.path, folder);
    const auto hasMask = [](const View& view) { return !view.mask_path.empty(); };
    const bool has_some = std::any_of(dataset.views.begin(), dataset.views.end(), hasMask);
    if (warns && !has_some && std::filesystem::is_directory(folder / "masks"))
        dataset.warnings.push_back((folder / "masks").string() +
                                   ": no mask has the name of a photograph, as NAME.png or NAME.jpg.png; none is used");
}

/// Returns whether the mask had another size.
bool loadMask(View& view, const DatasetOptions& options) {
    bool was_scaled = false;
    if (!view.mask_path.empty()) view.mask = readMask(view.mask_path, view.photo.width, view.photo.height, was_scaled);
    if (options.alpha_masks) maskByAlpha(view.photo, view.mask, view.path);
    if (view.mask.empty() || options.downscale == 1) return was_scaled;
    view.mask = downscaled(view.mask, options.downscale);
    if (view.mask.count() == 0) {
        const bool is_alpha = view.mask_path.empty();
        throw DataError((is_alpha ? view.path : view.mask_path).string(),
                        "a mask that hides every block of " + std::to_string(options.downscale) + "x" +
                            std::to_string(options.downscale) + " pixels",
                        "a block that counts as a whole",
                        std::string("use a smaller --downscale, or ") + (is_alpha ? "no --alpha-masks" : "--no-masks"));
    }
    return was_scaled;
}

/// What pixels say of alpha, where headers said only that there is a channel for it.
void tellOfAlpha(Dataset& dataset, bool has_alpha, bool warns, Report& report) {
    const auto n = std::count_if(dataset.views.begin(), dataset.views.end(), [](const View& v) { return v.photo.has_alpha; });
    dataset.has_alpha = n > 0 || has_alpha;
    if (!warns || n == 0 || n == std::ssize(dataset.views)) return;
    dataset.warnings.push_back(dataset.root.string() + ": " + std::to_string(n) + " of " +
                               std::to_string(dataset.views.size()) +
                               " photographs are transparent somewhere, which says that nothing is there, and the others nowhere; "
                               "where alpha hides what is not to be learned, use --alpha-masks");
    report.warn(dataset.warnings.back());
}

void downscaleCameras(Dataset& dataset, int n) {
    for (View& view : dataset.views) {
        const Camera small = downscaled(view.camera, n);
        if (small.width < 1 || small.height < 1)
            throw UsageError("--downscale", std::to_string(n),
                             "no more than the smaller side of every photograph (" + view.path.string() + " is " +
                                 std::to_string(view.camera.width) + "x" + std::to_string(view.camera.height) + ")");
        view.camera = small;
    }
}

void tellOfMasks(Dataset& dataset, const std::vector<std::uint8_t>& was_scaled, Report& report) {
    const auto n = std::count_if(dataset.views.begin(), dataset.views.end(), [](const View& v) { return !v.mask.empty(); });
    if (n == 0) return;
    char text[96];
    std::snprintf(text, sizeof text, "masks leave out %.1f %% of all pixels", 100 * maskedShare(dataset));
    report.info(text);
    const auto warn = [&](const std::string& line) {
        dataset.warnings.push_back(dataset.root.string() + ": " + line);
        report.warn(dataset.warnings.back());
    };
    const std::string of_all = " of " + std::to_string(dataset.views.size()) + " photographs ";
    if (const auto none = dataset.views.size() - static_cast<std::size_t>(n); none > 0)
        warn(std::to_string(none) + of_all + "have no mask; all of their pixels count");
    if (const auto first = std::find(was_scaled.begin(), was_scaled.end(), 1); first != was_scaled.end())
        warn(std::to_string(std::count(was_scaled.begin(), was_scaled.end(), 1)) + of_all +
             "have a mask of another size, which was scaled (first: " +
             dataset.views[static_cast<std::size_t>(first - was_scaled.begin())].mask_path.string() + ")");
}

/// Where photographs go that are too many for memory; null if they are not.
std::unique_ptr<PhotoCache> cacheFor(const Dataset& dataset, const DatasetOptions& options, Report& report) {
    std::size_t bytes = 0;
    for (const View& view : dataset.views)
        bytes += static_cast<std::size_t>(view.camera.width) * view.camera.height * sizeof(Photo::Pixel);
    if (!options.max_photo_bytes || bytes <= *options.max_photo_bytes) return nullptr;
    const std::filesystem::path folder = options.cache_folder.empty() ? "." : options.cache_folder;
    report.info("photographs of " + std::to_string(bytes >> 20) + " MiB are kept on disk, in " + folder.string() + ": memory has " +
                std::to_string(*options.max_photo_bytes >> 20) + " MiB for them");
    return std::make_unique<PhotoCache>(folder);
}

/// Decodes in blocks, in parallel: between blocks the caller hears how far it is and may stop it. An exception
/// must not leave a parallel loop (which of several would win is chance): each is kept, the first is thrown.
void loadPhotos(Dataset& dataset, Split split, const DatasetOptions& options, Report& report) {
    const std::size_t n = dataset.views.size();
    const std::unique_ptr<PhotoCache> cache = cacheFor(dataset, options, report);
    const std::size_t block = (cache ? 1 : 8) * static_cast<std::size_t>(threadCount());
    std::vector<std::uint8_t> was_scaled(n, 0);
    report.begin("read images", static_cast<std::int64_t>(n));
    for (std::size_t begin = 0; begin < n; begin += block) {
        if (report.cancelled()) throw Interrupted("reading images was stopped");
        const std::size_t end = std::min(begin + block, n);
        std::vector<std::exception_ptr> errors(end - begin);
        parallelFor(end - begin, [&](std::size_t i) {
            View& view = dataset.views[begin + i];
            try {
                view.photo = readPhoto(view.path);
                if (options.no_alpha) layOnWhite(view.photo);
                was_scaled[begin + i] = loadMask(view, options);
                if (options.downscale > 1) view.photo = downscaled(view.photo, options.downscale);
                if (cache) view.photo = cache->add(view.photo);
            } catch (...) {
                errors[i] = std::current_exception();
            }
        });
        for (const std::exception_ptr& error : errors)
            if (error) std::rethrow_exception(error);
        report.update(static_cast<std::int64_t>(end), "");
    }
    report.end();
    tellOfAlpha(dataset, options.has_alpha, split == Split::train, report);
    tellOfMasks(dataset, was_scaled, report);
}

/// Cameras and paths, by whichever reader knows what is there.
Dataset readFrames(const std::filesystem::path& path, Split split, const DatasetOptions& options) {
    if (!std::filesystem::exists(path))
        throw IoError(path.string(), "no such file or folder", "a data set", "check the name");
    if (hasTransforms(path)) return readTransforms(path, split, options.strict, options.check_poses);
    if (hasColmap(path)) return readColmap(path, split, options.strict);
    if (hasLlff(path)) return readLlff(path, split);
    throw DataError(path.string(), "no data set that is known",
                    "transforms_train.json or transforms.json (NeRF-synthetic, instant-ngp, nerfstudio), sparse/0, sparse, "
                    "colmap/sparse/0 or cameras.bin or .txt (COLMAP), or poses_bounds.npy (LLFF)",
                    "name the folder that holds one of them");
}

}  // namespace

Dataset readDataset(const std::filesystem::path& path, Split split, const DatasetOptions& options,
                    Report& report) {
    Dataset dataset = readFrames(path, split, options);
    if (options.use_masks)
        findMasks(dataset, std::filesystem::is_directory(path) ? path : path.parent_path(),
                  /*warns=*/split == Split::train && !options.alpha_masks);
    else
        for (View& view : dataset.views) view.mask_path.clear();
    if (split == Split::train) warnOfStrayCameras(dataset);
    for (const std::string& warning : dataset.warnings) report.warn(warning);
    if (options.choose) std::erase_if(dataset.views, [&](const View& view) { return !options.choose(view.camera); });
    if (split == Split::train && options.check_poses) checkPositionsDiffer(dataset);
    if (options.downscale > 1) downscaleCameras(dataset, options.downscale);
    if (options.load_photos) loadPhotos(dataset, split, options, report);
    return dataset;
}

bool isTransparent(const Dataset& dataset, std::size_t most) {
    const std::size_t n = std::min(most, dataset.views.size());
    std::atomic<bool> found = false;
    if (dataset.has_alpha)
        parallelFor(n, [&](std::size_t i) {
            if (found) return;
            try {
                if (readPhoto(dataset.views[i * dataset.views.size() / n].path).has_alpha) found = true;
            } catch (const Error&) {
                found = true;
            }
        });
    return found;
}

double maskedShare(const Dataset& dataset) {
    double masked = 0, all = 0;
    for (const View& view : dataset.views) {
        const double pixels = static_cast<double>(view.camera.width) * view.camera.height;
        if (!view.mask.empty()) masked += pixels - static_cast<double>(view.mask.count());
        all += pixels;
    }
    return all > 0 ? masked / all : 0;
}

Vec3f meanColour(const Dataset& dataset) {
    constexpr std::size_t kStride = 101;  // a prime: no column of pixels is looked at again and again
    Vec3d sum = Vec3d::Zero();
    double n = 0;
    for (const View& view : dataset.views)
        for (std::size_t i = 0; i < view.photo.pixelCount(); i += kStride) {
            const auto width = static_cast<std::size_t>(view.photo.width);
            const int x = static_cast<int>(i % width), y = static_cast<int>(i / width);
            if (!view.mask.counts(x, y)) continue;
            for (int c = 0; c < 3; ++c) sum[c] += view.photo.at(x, y)[c] / 255.0;
            ++n;
        }
    return n > 0 ? Vec3f((sum / n).cast<float>()) : Vec3f::Zero();
}

Box sceneBoxFromAabbScale(double aabb_scale) {
    const Vec3d half = Vec3d::Constant(0.5 * aabb_scale / kInstantNgpScale);
    return {-half, half};
}

}  // namespace nerfvdb
