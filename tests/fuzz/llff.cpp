// SPDX-License-Identifier: Apache-2.0
// poses_bounds.npy of two images.
#include "core/image.h"
#include "tests/fuzz/reader.h"
#include "trainer/read_llff.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const bool has_images = [] {
        for (const char* name : {"a.png", "b.png"}) {
            fuzz::fileOf({}, std::string("images/") + name);
            writeImage(fuzz::folder() / "images" / name, Image(4, 3, 3));
        }
        return true;
    }();
    (void)has_images;
    fuzz::fileOf(fuzz::textOf(data, size), "poses_bounds.npy");
    for (const Split split : {Split::train, Split::test})
        fuzz::isRead([&] {
            for (const View& view : readLlff(fuzz::folder(), split).views)
                fuzz::require(cameraProblem(view.camera).empty(), "usable cameras");
        });
    return 0;
}
