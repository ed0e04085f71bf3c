// SPDX-License-Identifier: Apache-2.0
// transforms.json beside two images and a mask; an image outside of the data set's folder waits for who comes there.
#include "core/image.h"
#include "tests/fuzz/reader.h"
#include "trainer/read_transforms.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const std::filesystem::path scene = [] {
        for (const char* name : {"outside.png", "scene/a.png", "scene/b.png", "scene/mask.png"}) {
            fuzz::fileOf({}, name);
            writeImage(fuzz::folder() / name, Image(4, 3, 3));
        }
        return fuzz::folder() / "scene";
    }();
    fuzz::fileOf(fuzz::textOf(data, size), "scene/transforms.json");
    const auto isReadAs = [](Split split, bool strict) {
        return fuzz::isRead([&] {
            for (const View& view : readTransforms(scene, split, strict).views) {
                fuzz::require(fuzz::liesInside(view.path, scene), "images inside the data set's folder");
                fuzz::require(view.mask_path.empty() || fuzz::liesInside(view.mask_path, scene),
                              "masks inside the data set's folder");
                fuzz::require(cameraProblem(view.camera).empty(), "usable cameras");
            }
        });
    };
    const bool is_readable = isReadAs(Split::train, /*strict=*/false);
    const bool is_sound = isReadAs(Split::train, /*strict=*/true);
    fuzz::require(is_readable || !is_sound, "strict reading takes no more than lenient reading");
    if (is_readable) isReadAs(Split::test, /*strict=*/false);
    return 0;
}
