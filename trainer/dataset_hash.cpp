// SPDX-License-Identifier: Apache-2.0
#include "trainer/dataset_hash.h"

#include <span>
#include <vector>

#include "core/atomic_file.h"
#include "core/parallel.h"
#include "core/photo_cache.h"

namespace nerfvdb {
namespace {

/// The same wherever the pixels are kept.
std::string photoHash(const Photo& photo) {
    if (!photo.tiles) return contentHash(std::as_bytes(std::span(photo.pixels)));
    const std::vector<Photo::Pixel> rows = rowsOf(photo);
    releasePages(photo);
    return contentHash(std::as_bytes(std::span(rows)));
}

std::string viewHash(const View& view) {
    const Camera& c = view.camera;
    const Distortion& d = c.distortion;
    std::vector<double> numbers = {static_cast<double>(c.width), static_cast<double>(c.height)};
    numbers.insert(numbers.end(), {c.fx, c.fy, c.cx, c.cy, d.k1, d.k2, d.k3, d.p1, d.p2, d.k4, d.k5, d.k6,
                                   static_cast<double>(d.model)});
    numbers.insert(numbers.end(), c.world_from_camera.data(), c.world_from_camera.data() + 9);
    numbers.insert(numbers.end(), c.position.data(), c.position.data() + 3);
    return contentHash(std::as_bytes(std::span(numbers))) +
           photoHash(view.photo) +
           (view.mask.empty() ? "" : contentHash(std::as_bytes(std::span(view.mask.tiles()))));
}

}  // namespace

std::string datasetHash(const Dataset& dataset) {
    std::vector<std::string> views(dataset.views.size());
    parallelFor(views.size(), [&](std::size_t i) { views[i] = viewHash(dataset.views[i]); });
    std::string all;
    for (const std::string& view : views) all += view;
    return contentHash(std::as_bytes(std::span(all)));
}

}  // namespace nerfvdb
