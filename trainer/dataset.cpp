// SPDX-License-Identifier: Apache-2.0
#include "trainer/dataset.h"

#include <algorithm>
#include <exception>

#include "core/error.h"
#include "core/parallel.h"
#include "trainer/read_colmap.h"
#include "trainer/read_llff.h"
#include "trainer/read_transforms.h"

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

/// Decodes in blocks, in parallel: between blocks the caller hears how far it is and may stop it. An exception
/// must not leave a parallel loop (which of several would win is chance): each is kept, the first is thrown.
void loadPhotos(Dataset& dataset, Report& report) {
    const std::size_t n = dataset.views.size();
    const std::size_t block = 8 * static_cast<std::size_t>(threadCount());
    report.begin("read images", static_cast<std::int64_t>(n));
    for (std::size_t begin = 0; begin < n; begin += block) {
        if (report.cancelled()) throw Interrupted("reading images was stopped");
        const std::size_t end = std::min(begin + block, n);
        std::vector<std::exception_ptr> errors(end - begin);
        parallelFor(end - begin, [&](std::size_t i) {
            View& view = dataset.views[begin + i];
            try {
                view.photo = readPhoto(view.path);
            } catch (...) {
                errors[i] = std::current_exception();
            }
        });
        for (const std::exception_ptr& error : errors)
            if (error) std::rethrow_exception(error);
        report.update(static_cast<std::int64_t>(end), "");
    }
    report.end();
}

/// Cameras and paths, by whichever reader knows what is there.
Dataset readFrames(const std::filesystem::path& path, Split split, bool strict) {
    if (!std::filesystem::exists(path))
        throw IoError(path.string(), "no such file or folder", "a data set", "check the name");
    if (hasTransforms(path)) return readTransforms(path, split, strict);
    if (hasColmap(path)) return readColmap(path, split, strict);
    if (hasLlff(path)) return readLlff(path, split);
    throw DataError(path.string(), "no data set that is known",
                    "transforms_train.json or transforms.json (NeRF-synthetic, instant-ngp, nerfstudio), sparse/0, sparse, "
                    "colmap/sparse/0 or cameras.bin or .txt (COLMAP), or poses_bounds.npy (LLFF)",
                    "name the folder that holds one of them");
}

}  // namespace

Dataset readDataset(const std::filesystem::path& path, Split split, const DatasetOptions& options,
                    Report& report) {
    Dataset dataset = readFrames(path, split, options.strict);
    for (const std::string& warning : dataset.warnings) report.warn(warning);
    if (split == Split::train) checkPositionsDiffer(dataset);
    if (options.load_photos) loadPhotos(dataset, report);
    return dataset;
}

Box sceneBoxFromAabbScale(double aabb_scale) {
    const Vec3d half = Vec3d::Constant(0.5 * aabb_scale / kInstantNgpScale);
    return {-half, half};
}

}  // namespace nerfvdb
