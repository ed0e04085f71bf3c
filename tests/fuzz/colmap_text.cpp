// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/colmap.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const testing::ColmapScene& scene = fuzz::smallColmapScene();
    fuzz::readColmapWith(data, size, {"cameras.txt", "images.txt", "points3D.txt"},
                         {scene.camerasText(), scene.imagesText(), scene.pointsText()});
    return 0;
}
