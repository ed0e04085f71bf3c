// SPDX-License-Identifier: Apache-2.0
#include "cli/camera_path.h"
#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = fuzz::fileOf(fuzz::textOf(data, size), "path.json");
    PictureSize asked;
    fuzz::isRead([&] {
        for (const Camera& camera : readCameraPath(file, asked))
            fuzz::require(cameraProblem(camera).empty(), "usable cameras");
    });
    asked.width = 8, asked.height = 6, asked.fov_y_rad = 1;
    fuzz::isRead([&] { readCameraPath(file, asked); });
    return 0;
}
