// SPDX-License-Identifier: Apache-2.0
// Images in memory and on disk. OpenImageIO stays inside image.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace nerfvdb {

/// Float image, rows from the top, channels interleaved: pixels[(y * width + x) * channels + c].
/// Colour values are sRGB-encoded in [0, 1] unless a name says linear.
struct Image {
    int width = 0, height = 0, channels = 0;
    std::vector<float> pixels;

    Image() = default;
    Image(int w, int h, int c)
        : width(w), height(h), channels(c), pixels(static_cast<std::size_t>(w) * h * c, 0.0f) {}
    float* at(int x, int y) { return &pixels[(static_cast<std::size_t>(y) * width + x) * channels]; }
    const float* at(int x, int y) const {
        return &pixels[(static_cast<std::size_t>(y) * width + x) * channels];
    }
};

/// One photograph as training keeps it: 8-bit sRGB with straight (unassociated) alpha, 4 bytes a pixel.
struct Photo {
    using Pixel = std::array<std::uint8_t, 4>;
    static constexpr int kTile = 8;  // pixels along the side of a tile

    int width = 0, height = 0;
    bool has_alpha = false;              // of some pixel less than 255
    std::vector<Pixel> pixels;           // rows from the top; empty where they are ...
    std::shared_ptr<const Pixel> tiles;  // ... in a PhotoCache, tile by tile, where neighbours share a page

    const Pixel& at(int x, int y) const {
        return tiles ? tiles.get()[tiledIndex(x, y)] : pixels[static_cast<std::size_t>(y) * width + x];
    }
    std::size_t pixelCount() const { return static_cast<std::size_t>(width) * height; }
    std::size_t tiledIndex(int x, int y) const {
        const std::size_t tiles_x = static_cast<std::size_t>((width + kTile - 1) / kTile);
        const std::size_t tile = static_cast<std::size_t>(y / kTile) * tiles_x + static_cast<std::size_t>(x / kTile);
        return tile * (kTile * kTile) + static_cast<std::size_t>(y % kTile * kTile + x % kTile);
    }
};

/// Lays a photograph on white and forgets its alpha: sRGB values are mixed, as programs that show pictures mix them.
void layOnWhite(Photo& photo);

/// Reads PNG, JPEG or EXR, whatever the file's name. Straight alpha; EXR is encoded to sRGB, clamped to [0, 1].
/// Throws IoError when the file cannot be opened, DataError when it cannot be decoded to the end
/// (a truncated file is an error, never a half-black picture) or holds non-finite values.
/// Grey becomes three equal colours, 16 bits are rounded to 8. Orientation tags are not applied.
Photo readPhoto(const std::filesystem::path& path);

/// What a picture says of itself before its pixels.
struct ImageHeader {
    int width = 0, height = 0;
    bool has_alpha = false;  // a channel for it, which may say that all is opaque
};

/// The header alone, without decoding. Throws as readPhoto.
ImageHeader readImageHeader(const std::filesystem::path& path);

/// What a photograph says of how it was taken (EXIF); empty or zero where it does not say.
struct PhotoOrigin {
    int width = 0, height = 0;
    std::string camera;          // make and model, and the lens where it has a name
    double focal_length_mm = 0;  // of the lens
    bool has_position = false;   // latitude and longitude
};

/// The header alone, without decoding. Throws as readPhoto.
PhotoOrigin readPhotoOrigin(const std::filesystem::path& path);

/// Reads every channel as float without any conversion (EXR stays linear, PNG becomes [0, 1]).
Image readImage(const std::filesystem::path& path);

/// Writes by extension: .png and .jpg clamp to [0, 1] and round to 8 bits; .exr keeps floats as they are.
/// 1, 3 or 4 channels (no alpha in .jpg). Writes to a temporary beside the target and renames.
/// Throws IoError; UsageError for another extension or number of channels; NumericError for NaN in 8 bits.
void writeImage(const std::filesystem::path& path, const Image& image);

/// sRGB transfer function (IEC 61966-2-1) and its inverse, on [0, inf).
float srgbFromLinear(float linear);
float linearFromSrgb(float srgb);

}  // namespace nerfvdb
