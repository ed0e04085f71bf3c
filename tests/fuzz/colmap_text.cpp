// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/colmap.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const nerfvdb::fuzz::SmallColmapScene scene;
    static const std::array sound{scene.camerasText(), scene.imagesText(), scene.pointsText()};
    return nerfvdb::fuzz::readColmapWith(data, size, {"cameras.txt", "images.txt", "points3D.txt"}, sound);
}
