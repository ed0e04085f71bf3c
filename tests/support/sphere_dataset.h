// SPDX-License-Identifier: Apache-2.0
// The synthetic sphere photographed in memory, as a reader would return it.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "core/parallel.h"
#include "trainer/dataset.h"
#include "trainer/exact_ray.h"
#include "trainer/write_dataset.h"

namespace nerfvdb::test {

/// Rounds a picture with straight alpha to what a file of 8 bits keeps.
inline Photo photoOf(const Image& image) {
    Photo photo;
    photo.width = image.width, photo.height = image.height;
    photo.has_alpha = true;
    photo.pixels.resize(static_cast<std::size_t>(image.width) * image.height);
    for (std::size_t i = 0; i < photo.pixels.size(); ++i)
        for (int c = 0; c < 4; ++c)
            photo.pixels[i][c] = static_cast<std::uint8_t>(std::lround(255 * image.pixels[4 * i + c]));
    return photo;
}

/// What these cameras see of `synth sphere`.
inline Dataset sphereDataset(const std::vector<Camera>& cameras) {
    const auto scene = makeSyntheticScene("sphere");
    Dataset dataset;
    dataset.root = "sphere";
    dataset.has_alpha = true;
    dataset.views.resize(cameras.size());
    parallelFor(cameras.size(), [&](std::size_t i) {
        dataset.views[i] = {cameras[i], "view " + std::to_string(i), photoOf(exactImage(*scene, cameras[i]))};
    });
    return dataset;
}

/// Views of one split of the data set that `synth sphere` writes: from above, and from a little below.
inline Dataset sphereDataset(Split split, int n_views, int size) {
    SyntheticDatasetOptions options;
    options.train_views = options.val_views = options.test_views = n_views;
    options.width = options.height = size;
    return sphereDataset(syntheticCameras(split, options));
}

/// Views from all around, evenly spread (Fibonacci's lattice), at the distance of those that `synth` makes.
inline Dataset surroundedSphereDataset(int n_views, int size) {
    const double distance = 4.03, fov = 0.69;  // world units, radians
    std::vector<Camera> cameras;
    for (int i = 0; i < n_views; ++i) {
        const double z = 1 - (2 * i + 1.0) / n_views, r = std::sqrt(1 - z * z);
        const double azimuth = std::numbers::pi * (3 - std::sqrt(5.0)) * i;
        const Vec3d eye = distance * Vec3d(r * std::cos(azimuth), r * std::sin(azimuth), z);
        cameras.push_back(lookAt(eye, Vec3d::Zero(), Vec3d::UnitZ(), fov, size, size));
    }
    return sphereDataset(cameras);
}

}  // namespace nerfvdb::test
