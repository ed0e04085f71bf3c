// SPDX-License-Identifier: Apache-2.0
#include "core/image.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>
#include <thread>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/exr_header.h"
#include "core/image_end.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/exif.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

/// Values on the 8-bit raster, so that PNG can keep them exactly; alpha goes through 0 too.
Image noise(int width, int height, int channels) {
    Image image(width, height, channels);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = static_cast<float>(randomBits(1, 2, i) & 0xFF) / 255.0f;
    return image;
}

Image gradientImage(int width, int height, int channels) {
    Image image(width, height, channels);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            for (int c = 0; c < channels; ++c)
                image.at(x, y)[c] = 0.5f + 0.4f * std::sin(0.05f * (x + 2 * y) + c);
    return image;
}

void overwrite(const fs::path& path, const std::string& bytes) { writeAtomically(path, bytes); }

/// Bytes from their hexadecimal digits.
std::string fromHex(const std::string& digits) {
    std::string bytes;
    for (std::size_t i = 0; i < digits.size(); i += 2)
        bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
    return bytes;
}

}  // namespace

TEST_CASE("16 bits, grey with alpha and palettes become 8-bit colour with alpha", "[core]") {
    const TempDir dir;
    // 2x1, 16-bit grey and alpha: (0x40f0, 0xffff), (0xfeff, 0x8000). 0x40f0 / 257 = 64.7, 0xfeff / 257 =
    // 254.0.
    overwrite(
        dir / "grey16.png",
        fromHex("89504e470d0a1a0a0000000d49484452000000020000000110040000000ebb6b42000000114944415478da6370"
                "f8f0ffffbfff0d0c001b8305acb4b8bad90000000049454e44ae426082"));
    const Photo grey = readPhoto(dir / "grey16.png");
    REQUIRE(grey.pixels.size() == 2);
    CHECK(grey.has_alpha);
    CHECK(grey.pixels[0] == std::array<std::uint8_t, 4>{65, 65, 65, 255});
    CHECK(grey.pixels[1] == std::array<std::uint8_t, 4>{254, 254, 254, 128});

    // 2x1 with a palette of (10, 20, 30, opaque) and (200, 100, 50, alpha 64), second colour first.
    overwrite(
        dir / "palette.png",
        fromHex("89504e470d0a1a0a0000000d4948445200000002000000010803000000c3fc8fb800000006504c54450a141ec8"
                "643277a0b39c0000000274524e53ff40936b71da0000000b4944415478da63606400000005000242c2449f0000"
                "000049454e44ae426082"));
    const Photo palette = readPhoto(dir / "palette.png");
    REQUIRE(palette.pixels.size() == 2);
    CHECK(palette.has_alpha);
    CHECK(readImageHeader(dir / "palette.png").has_alpha);
    CHECK(palette.pixels[0] == std::array<std::uint8_t, 4>{200, 100, 50, 64});
    CHECK(palette.pixels[1] == std::array<std::uint8_t, 4>{10, 20, 30, 255});
}

TEST_CASE("PNG keeps 8-bit values exactly, with straight alpha", "[core]") {
    const TempDir dir;
    const int channels = GENERATE(1, 3, 4);
    const Image image = noise(37, 23, channels);
    writeImage(dir / "a.png", image);

    const Image again = readImage(dir / "a.png");
    REQUIRE(again.channels == channels);
    REQUIRE(again.pixels.size() == image.pixels.size());
    float worst = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        worst = std::max(worst, std::abs(again.pixels[i] - image.pixels[i]));
    CHECK(worst < 1e-6f);  // the same byte, divided by 255 in two places

    const Photo photo = readPhoto(dir / "a.png");
    CHECK(photo.width == 37);
    CHECK(photo.height == 23);
    CHECK(photo.has_alpha == (channels == 4));
    bool same = true;
    for (std::size_t i = 0; i < photo.pixels.size(); ++i)
        for (int c = 0; c < 4; ++c) {
            const float expected = channels == 4 ? image.pixels[i * 4 + c]
                                   : c == 3      ? 1.0f
                                                 : image.pixels[i * channels + c % channels];
            same = same && photo.pixels[i][c] == std::lround(255 * expected);
        }
    CHECK(same);
    const ImageHeader header = readImageHeader(dir / "a.png");
    CHECK(header.width == 37);
    CHECK(header.height == 23);
    CHECK(header.has_alpha == photo.has_alpha);
}

TEST_CASE("writing 8 bits clamps, rounds and refuses NaN", "[core]") {
    const TempDir dir;
    Image image(3, 1, 1);
    image.pixels = {-1.0f, 0.5f, 7.0f};
    writeImage(dir / "a.png", image);
    const Photo photo = readPhoto(dir / "a.png");
    CHECK(photo.pixels[0][0] == 0);
    CHECK(photo.pixels[1][0] == 128);
    CHECK(photo.pixels[2][0] == 255);
    image.pixels[1] = std::numeric_limits<float>::quiet_NaN();
    CHECK_THROWS_AS(writeImage(dir / "a.png", image), NumericError);
    CHECK(readPhoto(dir / "a.png").pixels[1][0] == 128);  // the old file stands
}

TEST_CASE("EXR keeps floats as they are", "[core]") {
    const TempDir dir;
    const int channels = GENERATE(1, 3, 4);
    Image image = noise(16, 9, channels);
    image.pixels[0] = -3.5f;
    image.pixels[1] = 1e6f;
    writeImage(dir / "a.exr", image);
    CHECK(readImage(dir / "a.exr").pixels == image.pixels);
}

TEST_CASE("the same picture gives the same bytes", "[core]") {
    const TempDir dir;
    const std::string extensions[] = {".png", ".jpg", ".exr"};
    for (const std::string& extension : extensions) writeImage(dir / ("a" + extension), noise(16, 9, 3));
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // whoever writes the time writes seconds
    for (const std::string& extension : extensions) {
        INFO(extension);
        writeImage(dir / ("b" + extension), noise(16, 9, 3));
        CHECK((readFile(dir / ("a" + extension)) == readFile(dir / ("b" + extension))));
    }
}

TEST_CASE("an EXR photograph is encoded to sRGB with straight alpha", "[core]") {
    const TempDir dir;
    Image image(3, 1, 4);
    image.pixels = {0.25f, 0.5f, 0.1f,  0.5f,   // premultiplied: straight 0.5, 1, 0.2
                    0.0f,  0.0f, 0.0f,  0.0f,   // nothing there
                    2.0f,  1.0f, -1.0f, 1.0f};  // brighter than white, darker than black
    writeImage(dir / "a.exr", image);
    const Photo photo = readPhoto(dir / "a.exr");
    CHECK(photo.has_alpha);
    // sRGB of 0.5 is 0.735357, of 0.2 is 0.484529 (IEC 61966-2-1); times 255 and rounded.
    CHECK(photo.pixels[0] == std::array<std::uint8_t, 4>{188, 255, 124, 128});
    CHECK(photo.pixels[1] == std::array<std::uint8_t, 4>{0, 0, 0, 0});
    CHECK(photo.pixels[2] == std::array<std::uint8_t, 4>{255, 255, 0, 255});
}

TEST_CASE("a non-finite EXR pixel is named", "[core]") {
    const TempDir dir;
    Image image = gradientImage(8, 8, 3);
    image.at(5, 2)[1] =
        GENERATE(std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity());
    writeImage(dir / "a.exr", image);
    CHECK_THROWS_AS(readPhoto(dir / "a.exr"), DataError);
    CHECK_THROWS_WITH(readPhoto(dir / "a.exr"), Contains("a.exr") && Contains("pixel (5, 2), channel G"));
}

TEST_CASE("JPEG is close to what was written", "[core]") {
    const TempDir dir;
    const int channels = GENERATE(1, 3);
    const Image image = gradientImage(64, 48, channels);
    writeImage(dir / "a.jpg", image);
    const Image again = readImage(dir / "a.jpg");
    REQUIRE(again.channels == channels);
    double sum = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) sum += std::abs(again.pixels[i] - image.pixels[i]);
    CHECK(sum / image.pixels.size() < 0.02);  // a smooth picture at quality 95: a few levels of 255
}

TEST_CASE("a photograph tells camera, focal length and place, where it knows them", "[core]") {
    const TempDir dir;
    writeImage(dir / "plain.jpg", Image(8, 6, 3));
    const PhotoOrigin plain = readPhotoOrigin(dir / "plain.jpg");
    CHECK(plain.width == 8);
    CHECK(plain.height == 6);
    CHECK(plain.camera.empty());
    CHECK(plain.focal_length_mm == 0);
    CHECK(!plain.has_position);

    const std::string jpeg = readFile(dir / "plain.jpg");
    writeAtomically(dir / "told.jpg", nerfvdb::testing::withExif(jpeg, {"Maker", "Mark II", 24.5, {{-12.5, 131.25}}}));
    const PhotoOrigin told = readPhotoOrigin(dir / "told.jpg");
    CHECK(told.width == 8);
    CHECK(told.camera == "Maker Mark II");
    CHECK(told.focal_length_mm == Approx(24.5));
    CHECK(told.has_position);
    CHECK(readPhoto(dir / "told.jpg").pixels.size() == 48);

    writeAtomically(dir / "nowhere.jpg", nerfvdb::testing::withExif(jpeg, {"Maker", "", 0, {}}));
    CHECK(readPhotoOrigin(dir / "nowhere.jpg").camera == "Maker");
    CHECK(!readPhotoOrigin(dir / "nowhere.jpg").has_position);
}

TEST_CASE("a file cut short anywhere is an error", "[core]") {
    const TempDir dir;
    const std::string extension = GENERATE(".png", ".jpg", ".exr");
    const fs::path path = dir / ("a" + extension);
    writeImage(path, gradientImage(64, 48, 3));
    const std::string bytes = readFile(path);
    CHECK_NOTHROW(readPhoto(path));

    const std::size_t keep =
        GENERATE(0, 2, 40, 101, 50, 90, 99, 100);  // to 40 bytes, then per cent; 100: less 1
    const std::size_t size = keep <= 40 ? keep : keep == 101 ? 200 : bytes.size() * keep / 100 - (keep == 100);
    CAPTURE(extension, size, bytes.size());
    overwrite(path, bytes.substr(0, size));
    CHECK_THROWS_AS(readPhoto(path), DataError);
    CHECK_THROWS_AS(readImage(path), DataError);
    CHECK_THROWS_WITH(readPhoto(path), Contains(path.filename().string()));
}

TEST_CASE("an image with a hole is an error though it has its end mark", "[core]") {
    const TempDir dir;
    const std::string extension = GENERATE(".png", ".jpg");
    const fs::path path = dir / ("a" + extension);
    writeImage(path, gradientImage(64, 48, 3));
    const std::string bytes = readFile(path);
    if (extension == ".png") {
        std::string damaged = bytes;
        damaged[bytes.size() * 2 / 3] ^= 0x55;  // any bit: chunks carry checksums
        overwrite(path, damaged);
    } else {
        overwrite(path, bytes.substr(0, bytes.size() * 2 / 3) + "\xFF\xD9");  // a half, closed properly
    }
    CHECK_THROWS_AS(readPhoto(path), DataError);
}

TEST_CASE("bytes after the end mark and thumbnails inside do not confuse the end check", "[core]") {
    using namespace std::string_literals;
    const std::string start = "\xFF\xD8"s;
    const std::string thumbnail = "\xFF\xE1\x00\x06\xFF\xD8\xFF\xD9"s;  // APP1 with a whole JPEG in it
    const std::string scan = "\xFF\xDA\x00\x04\x01\x02 data\xFF\x00more\xFF\xD3rest"s;
    CHECK_FALSE(isTruncatedImage(start + thumbnail + scan + "\xFF\xD9"s));
    CHECK_FALSE(isTruncatedImage(start + thumbnail + scan + "\xFF\xD9 trailer"s));
    CHECK(isTruncatedImage(start + thumbnail + scan));
    CHECK(isTruncatedImage(start + thumbnail));
    CHECK(isTruncatedImage(start + "\xFF\xE1"s));
    CHECK_FALSE(isTruncatedImage("something else"));
}

TEST_CASE("an EXR whose attribute is longer than its file is refused before memory is taken for it", "[core]") {
    const TempDir dir;
    writeImage(dir / "a.exr", noise(8, 8, 3));
    std::string bytes = readFile(dir / "a.exr");
    const std::size_t length = bytes.find('\0', bytes.find('\0', 8) + 1) + 1;  // of the first attribute's value
    bytes.replace(length, 4, "\xF0\xFF\xFF\x7F");  // 2 GiB
    overwrite(dir / "a.exr", bytes);
    CHECK_THROWS_WITH(readImageHeader(dir / "a.exr"), Contains("a.exr") && Contains("too short"));
}

TEST_CASE("every header of an EXR is walked, and no further", "[core]") {
    using namespace std::string_literals;
    const auto isSound = [](const std::string& bytes) {
        std::istringstream stream(bytes);
        return exrHeaderProblem(stream).empty();
    };
    const std::string one_part = "\x76\x2f\x31\x01\x02\0\0\0"s, parts = "\x76\x2f\x31\x01\x02\x10\0\0"s;
    const std::string header = "a\0int\0\x04\0\0\0abcd\0"s, cut = "a\0string\0\x05\0\0\0abcd"s;
    CHECK(isSound(one_part + header));
    CHECK(isSound(one_part + header + cut));  // pixels
    CHECK(isSound(parts + header + header + "\0"s));
    CHECK_FALSE(isSound(parts + header + cut));
    CHECK_FALSE(isSound(parts + header + header));
    for (std::size_t size = 0; size < (one_part + header).size(); ++size)
        CHECK_FALSE(isSound((one_part + header).substr(0, size)));
    CHECK_FALSE(isSound(one_part + std::string(300, 'a')));
}

TEST_CASE("attributes of an EXR are as long as they state", "[core]") {
    using namespace std::string_literals;
    const auto isSound = [](const std::string& type, const std::string& value) {
        std::istringstream stream("\x76\x2f\x31\x01\x02\0\0\0a\0"s + type + '\0' + static_cast<char>(value.size()) +
                                  "\0\0\0"s + value + '\0');
        return exrHeaderProblem(stream).empty();
    };
    const std::string channel = "R\0"s + std::string(16, '\1');
    CHECK(isSound("chlist", channel + channel + "\0"s));
    CHECK_FALSE(isSound("chlist", channel + channel));             // no end
    CHECK_FALSE(isSound("chlist", channel + "\0more"s));
    CHECK_FALSE(isSound("chlist", channel.substr(0, 9) + "\0"s));
    CHECK(isSound("stringvector", "\2\0\0\0ab\0\0\0\0"s));
    CHECK_FALSE(isSound("stringvector", "\2\0\0\x40""ab"s));     // a gigabyte
    CHECK(isSound("preview", "\1\0\0\0\2\0\0\0abcdefgh"s));
    CHECK_FALSE(isSound("preview", "\1\0\0\0\3\0\0\0abcdefgh"s));
    CHECK_FALSE(isSound("preview", "\xff\xff\xff\xff\xff\xff\xff\xff"s));
    CHECK(isSound("v2f", "12345678"));
    CHECK_FALSE(isSound("v2f", "1234567"));
    CHECK_FALSE(isSound("idmanifest", "12345678"));
    CHECK(isSound("of our own", "12345678"));
    CHECK(isSound("box2i", "\0\0\0\0\0\0\0\0\xff\xff\0\0\0\0\0\0"s));
    CHECK_FALSE(isSound("box2i", "\0\0\0\0\0\0\0\0\0\0\1\0\0\0\0\0"s));           // 65537 wide
    CHECK_FALSE(isSound("box2i", "\1\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"s));           // empty
    CHECK_FALSE(isSound("box2i", "\0\0\0\x80\0\0\0\0\xff\xff\xff\x7f\0\0\0\0"s));  // 2^32 wide
    CHECK(isSound("tiledesc", "\0\x10\0\0\x20\0\0\0\0"s));
    CHECK_FALSE(isSound("tiledesc", "\1\x10\0\0\x20\0\0\0\0"s));
    CHECK_FALSE(isSound("tiledesc", "\1\0\0\0\0\0\0\0\0"s));
}

TEST_CASE("files that are no images are told apart", "[core]") {
    const TempDir dir;
    CHECK_THROWS_AS(readPhoto(dir / "absent.png"), IoError);
    CHECK_THROWS_WITH(readPhoto(dir / "absent.png"), Contains("absent.png") && Contains("No such file"));
    overwrite(dir / "text.png", "this is not a picture, but it is long enough to look at");
    CHECK_THROWS_AS(readPhoto(dir / "text.png"), DataError);
    CHECK_THROWS_AS(readImageHeader(dir / "text.png"), DataError);
}

TEST_CASE("a PNG that is called .jpg is read for what it is", "[core]") {
    const TempDir dir;
    writeImage(dir / "a.png", noise(8, 8, 4));
    fs::copy_file(dir / "a.png", dir / "b.jpg");
    CHECK(readPhoto(dir / "b.jpg").pixels == readPhoto(dir / "a.png").pixels);
}

TEST_CASE("a disk that fills up while a picture is written leaves the old picture", "[core]") {
    const TempDir dir;
    const fs::path path = dir / ("a" + GENERATE(std::string(".png"), std::string(".jpg"), std::string(".exr")));
    writeImage(path, noise(4, 4, 3));
    const std::string old = readFile(path);
    const Image big = noise(200, 200, 3);
    {
        const SmallDisk disk(20000);
        CHECK_THROWS_AS(writeImage(path, big), IoError);
        CHECK_THROWS_WITH(writeImage(path, big), Contains(path.string()));
    }
    CHECK((readFile(path) == old));  // parentheses: a failure should not print bytes
    CHECK(std::distance(fs::directory_iterator(dir.path()), fs::directory_iterator()) == 1);
}

TEST_CASE("pictures that a format cannot hold are refused", "[core]") {
    const TempDir dir;
    CHECK_THROWS_AS(writeImage(dir / "a.jpg", Image(4, 4, 4)), UsageError);
    CHECK_THROWS_AS(writeImage(dir / "a.png", Image(4, 4, 2)), UsageError);
    CHECK_THROWS_AS(writeImage(dir / "a.png", Image()), UsageError);
    CHECK_THROWS_WITH(writeImage(dir / "a.gif", Image(4, 4, 3)), Contains("'.gif'"));
    CHECK_THROWS_AS(writeImage(dir / "absent" / "a.png", Image(4, 4, 3)), IoError);
}

TEST_CASE("the transfer function is IEC 61966-2-1 and its inverse", "[core]") {
    CHECK(srgbFromLinear(0.0f) == 0.0f);
    CHECK(srgbFromLinear(0.18f) == Approx(0.461356).epsilon(1e-5));
    CHECK(srgbFromLinear(1.0f) == Approx(1.0).epsilon(1e-6));
    for (int i = 0; i <= 300; ++i) {
        const float x = i / 200.0f;
        CHECK(linearFromSrgb(srgbFromLinear(x)) == Approx(x).epsilon(1e-5).margin(1e-6));  // two float powers
    }
}
