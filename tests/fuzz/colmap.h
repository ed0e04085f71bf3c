// SPDX-License-Identifier: Apache-2.0
// A COLMAP model of which one part is the input (its first byte says which) and the others are sound.
#pragma once

#include <array>

#include "tests/fuzz/reader.h"
#include "tests/trainer/colmap_scene.h"
#include "trainer/read_colmap.h"

namespace nerfvdb::fuzz {

/// `names` and `sound` are of cameras, images and points3D.
inline void readColmapWith(const std::uint8_t* data, std::size_t size, const std::array<const char*, 3>& names,
                           const std::array<std::string, 3>& sound) {
    if (size == 0) return;
    const std::size_t part = data[0] % 3;
    for (std::size_t i = 0; i < 3; ++i)
        fileOf(i == part ? textOf(data + 1, size - 1) : std::string_view(sound[i]), std::string("sparse/0/") + names[i]);
    for (const bool strict : {false, true})
        isRead([&] {
            for (const View& view : readColmap(folder(), Split::train, strict).views) {
                require(liesInside(view.path, folder() / "images"), "images inside the data set's folder");
                require(cameraProblem(view.camera).empty(), "usable cameras");
            }
        });
}

/// Three images, laid beside the model at the first call.
inline const testing::ColmapScene& smallColmapScene() {
    static testing::ColmapScene scene;
    if (scene.images.size() == 3) return scene;
    scene.images.resize(3);
    scene.points.resize(4);
    for (ColmapImage& image : scene.images) image.observations.resize(2);
    for (ColmapPoint& point : scene.points) point.track_length = 2;
    for (const ColmapImage& image : scene.images) {
        fileOf({}, "images/" + image.name);
        writeImage(folder() / "images" / image.name, Image(40, 20, 3));
    }
    return scene;
}

}  // namespace nerfvdb::fuzz
