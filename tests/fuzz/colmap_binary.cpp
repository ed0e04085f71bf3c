// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/colmap.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const nerfvdb::fuzz::SmallColmapScene scene;
    static const std::array sound{scene.camerasBinary(), scene.imagesBinary(), scene.pointsBinary()};
    return nerfvdb::fuzz::readColmapWith(data, size, {"cameras.bin", "images.bin", "points3D.bin"}, sound);
}
