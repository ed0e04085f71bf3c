// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/colmap.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const testing::ColmapScene& scene = fuzz::smallColmapScene();
    fuzz::readColmapWith(data, size, {"cameras.bin", "images.bin", "points3D.bin"},
                         {scene.camerasBinary(), scene.imagesBinary(), scene.pointsBinary()});
    return 0;
}
