// SPDX-License-Identifier: Apache-2.0
// A COLMAP model of which one part is the input (its first byte says which) and the others are sound.
#pragma once

#include <array>

#include "tests/fuzz/reader.h"
#include "tests/trainer/colmap_scene.h"
#include "trainer/read_colmap.h"

namespace nerfvdb::fuzz {

/// `names` and `sound` are of cameras, images and points3D.
inline int readColmapWith(const std::uint8_t* data, std::size_t size, const std::array<const char*, 3>& names,
                          const std::array<std::string, 3>& sound) {
    if (size == 0) return 0;
    const auto fileOfPart = [&](std::size_t part, std::string_view bytes) {
        fileOf(bytes, std::string("sparse/0/") + names[part]);
    };
    static std::size_t last = 3;  // the part that is not sound; none yet
    const std::size_t part = data[0] % 3;
    for (std::size_t i = 0; i < 3; ++i)
        if (i != part && (last == 3 || last == i)) fileOfPart(i, sound[i]);
    last = part;
    fileOfPart(part, textOf(data + 1, size - 1));
    for (const bool strict : {false, true})
        isRead([&] {
            for (const View& view : readColmap(folder(), Split::train, strict).views) {
                require(liesInside(view.path, folder() / "images"), "images inside the data set's folder");
                require(cameraProblem(view.camera).empty(), "usable cameras");
            }
        });
    return 0;
}

/// Of three images, which it lays beside the model.
struct SmallColmapScene : testing::ColmapScene {
    SmallColmapScene() {
        images.resize(3);
        points.resize(4);
        for (ColmapImage& image : images) image.observations.resize(2);
        for (ColmapPoint& point : points) point.track_length = 2;
        for (const ColmapImage& image : images) {
            fileOf({}, "images/" + image.name);
            writeImage(fuzz::folder() / "images" / image.name, Image(40, 20, 3));
        }
    }
};

}  // namespace nerfvdb::fuzz
