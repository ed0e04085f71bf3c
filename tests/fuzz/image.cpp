// SPDX-License-Identifier: Apache-2.0
// A PNG, JPEG or EXR as a photograph, and as a picture of plain numbers. The first byte chooses the extension.
#include "core/image.h"

#include <array>

#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    constexpr std::array<const char*, 3> kNames{"input.png", "input.jpg", "input.exr"};
    const auto file = fuzz::fileOf(fuzz::textOf(data + 1, size - 1), kNames[data[0] % kNames.size()]);
    ImageHeader header;
    if (!fuzz::isRead([&] { header = readImageHeader(file); })) return 0;
    constexpr int kMostPixels = 1 << 20;  // a sound header may ask for a gigabyte, which takes time
    if (std::int64_t{header.width} * header.height > kMostPixels) return 0;
    fuzz::isRead([&] {
        const Photo photo = readPhoto(file);
        fuzz::require(photo.pixels.size() == photo.pixelCount(), "all pixels");
    });
    fuzz::isRead([&] { readImage(file); });
    return 0;
}
