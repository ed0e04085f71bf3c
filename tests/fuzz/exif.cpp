// SPDX-License-Identifier: Apache-2.0
// What a photograph says of how it was taken: the input is the EXIF segment of a JPEG that is sound otherwise.
#include <algorithm>

#include "core/atomic_file.h"
#include "core/image.h"
#include "tests/fuzz/reader.h"

using namespace nerfvdb;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const std::string sound = [] {
        writeImage(fuzz::folder() / "sound.jpg", Image(8, 8, 3));
        return readFile(fuzz::folder() / "sound.jpg");
    }();
    // ITU-T T.81, B.1.1.4: a marker (APP1), the segment's length with these two bytes, big-endian.
    const std::string head("Exif\0\0", 6);
    const std::size_t used = std::min<std::size_t>(size, 65000), length = used + head.size() + 2;
    std::string bytes = sound.substr(0, 2) + "\xff\xe1";
    bytes += static_cast<char>(length >> 8);
    bytes += static_cast<char>(length & 0xff);
    bytes += head;
    bytes += fuzz::textOf(data, used);
    bytes += sound.substr(2);
    const auto file = fuzz::fileOf(bytes, "input.jpg");
    fuzz::isRead([&] { readPhotoOrigin(file); });
    return 0;
}
