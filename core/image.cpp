// SPDX-License-Identifier: Apache-2.0
// The only file that knows OpenImageIO.
#include "core/image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/exif_header.h"
#include "core/exr_header.h"
#include "core/file_descriptor.h"
#include "core/image_end.h"
#include "core/png_chunks.h"

namespace nerfvdb {
namespace {

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;
namespace fs = std::filesystem;

constexpr std::int64_t kMaxPixels = std::int64_t{1} << 28;  // 16384 x 16384: beyond it a header is damaged
constexpr int kMaxChannels = 256;

/// The most pixels that so many bytes can hold: deflate packs 1032 to one, and of 1-bit pixels 8 are a byte. A header
/// that states more would have them allocated before anything is found missing.
std::int64_t mostPixels(std::uintmax_t file_bytes) {
    constexpr std::uintmax_t kPixelsInByte = 16384;
    return file_bytes > kMaxPixels / kPixelsInByte ? kMaxPixels
                                                   : static_cast<std::int64_t>(file_bytes * kPixelsInByte);
}

/// Parallelism is ours (parallel.h): one picture, one thread, in the library and in OpenEXR below it.
void quietenOpenImageIO() {
    static const bool done = [] {
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);  // -1: OpenEXR works in the calling thread
        return true;
    }();
    (void)done;
}

[[noreturn]] void throwUndecodable(const fs::path& path, const std::string& found) {
    throw DataError(path.string(), found, "a complete PNG, JPEG or EXR image", "replace the file");
}

std::string firstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

bool isExr(std::string_view bytes) { return bytes.starts_with("\x76\x2f\x31\x01"); }

/// OpenImageIO would try its other formats on a file of any name, down to ones that few ever looked at.
bool isKnownFormat(std::string_view bytes) {
    using namespace std::string_view_literals;
    return bytes.starts_with("\x89PNG\r\n\x1a\n"sv) || bytes.starts_with("\xFF\xD8\xFF"sv) || isExr(bytes);
}

/// Refuses what is no picture by its first bytes.
void checkBeginning(const fs::path& path) {
    { const PlainFile is_readable(path); }  // throws for what is none
    std::array<char, 8> first{};
    std::ifstream file(path, std::ios::binary);
    file.read(first.data(), first.size());
    if (!file && !file.eof()) throw IoError(path.string(), "a file that cannot be read", "an image", "check permissions");
    const std::string_view bytes(first.data(), static_cast<std::size_t>(file.gcount()));
    if (!isKnownFormat(bytes))
        throwUndecodable(path, bytes.empty() ? "an empty file" : "a file that begins as no image of these kinds");
    std::string problem = isExr(bytes) ? exrHeaderProblem(file) : pngChunkProblem(file);
    if (problem.empty()) problem = exifProblem(file);
    if (!problem.empty()) throwUndecodable(path, problem);
}

std::unique_ptr<ImageInput> openImage(const fs::path& path) {
    quietenOpenImageIO();
    checkBeginning(path);
    // By default colours would arrive multiplied by alpha, and rounded to 8 bits after that.
    ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    std::unique_ptr<ImageInput> input = ImageInput::open(path.string(), &config);
    if (!input) {
        // The library's general error text stays behind otherwise and is printed at exit.
        throwUndecodable(path, "an image that cannot be opened (" + firstLine(OIIO::geterror()) + ")");
    }
    const ImageSpec& spec = input->spec();
    if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1 ||
        spec.nchannels > kMaxChannels || std::int64_t{spec.width} * spec.height > mostPixels(fs::file_size(path)))
        throwUndecodable(path, "a size of " + std::to_string(spec.width) + "x" + std::to_string(spec.height) +
                                   "x" + std::to_string(spec.depth) + " with " +
                                   std::to_string(spec.nchannels) + " channels");
    if (spec.x != spec.full_x || spec.y != spec.full_y || spec.width != spec.full_width ||
        spec.height != spec.full_height)
        throw DataError(path.string(), "a data window that differs from the display window",
                        "pixels for the whole picture", "save it without cropping");
    return input;
}

/// All channels of the first subimage, as T. Any complaint of the decoder is an error: a warning of libjpeg
/// means that pixels were made up.
template <typename T>
std::vector<T> decode(const fs::path& path, ImageInput& input, TypeDesc type) {
    const ImageSpec& spec = input.spec();
    std::vector<T> values(static_cast<std::size_t>(spec.width) * spec.height * spec.nchannels);
    const bool done = input.read_image(0, 0, 0, spec.nchannels, type, values.data());
    if (!done || input.has_error())
        throwUndecodable(path, "an image that cannot be decoded (" + firstLine(input.geterror()) + ")");
    return values;
}

/// Asked before decoding: libpng would also print its complaint.
void checkEnd(const fs::path& path) {
    if (isTruncatedImage(readFile(path))) throwUndecodable(path, "a truncated image");
}

/// Which of the file's channels are red, green, blue and alpha (-1: none). Grey serves all three colours.
struct Channels {
    std::array<int, 3> rgb{0, 0, 0};
    int alpha = -1;
};

Channels findChannels(const ImageSpec& spec) {
    Channels channels;
    channels.alpha = spec.alpha_channel;
    const std::array<int, 3> named{spec.channelindex("R"), spec.channelindex("G"), spec.channelindex("B")};
    if (*std::min_element(named.begin(), named.end()) >= 0)
        channels.rgb = named;
    else if (spec.nchannels >= 3)
        channels.rgb = {0, 1, 2};
    return channels;
}

std::uint8_t byteFromUnit(float value) {
    return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
}

void checkFinite(const fs::path& path, const ImageSpec& spec, const std::vector<float>& values) {
    const auto bad = std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); });
    if (bad == values.end()) return;
    const std::size_t index = static_cast<std::size_t>(bad - values.begin()), pixel = index / spec.nchannels;
    throw DataError(path.string() + ": pixel (" + std::to_string(pixel % spec.width) + ", " +
                        std::to_string(pixel / spec.width) + "), channel " +
                        spec.channelnames[index % spec.nchannels],
                    std::to_string(*bad), "a finite value", "repair or leave out the image");
}

/// Linear light, colour multiplied by alpha (as EXR defines it) -> sRGB with straight alpha.
void photoFromLinear(const std::vector<float>& values, int stride, const Channels& channels, Photo& photo) {
    for (std::size_t i = 0; i < photo.pixels.size(); ++i) {
        const float* in = &values[i * stride];
        const float alpha = channels.alpha >= 0 ? std::clamp(in[channels.alpha], 0.0f, 1.0f) : 1.0f;
        const float inverse_alpha = alpha > 0 ? 1.0f / alpha : 0.0f;
        for (int c = 0; c < 3; ++c) {
            const float straight = std::clamp(in[channels.rgb[c]] * inverse_alpha, 0.0f, 1.0f);
            photo.pixels[i][c] = byteFromUnit(srgbFromLinear(straight));
        }
        photo.pixels[i][3] = byteFromUnit(alpha);
    }
}

void photoFromBytes(const std::vector<std::uint8_t>& values, int stride, const Channels& channels,
                    Photo& photo) {
    for (std::size_t i = 0; i < photo.pixels.size(); ++i) {
        const std::uint8_t* in = &values[i * stride];
        for (int c = 0; c < 3; ++c) photo.pixels[i][c] = in[channels.rgb[c]];
        photo.pixels[i][3] = channels.alpha >= 0 ? in[channels.alpha] : 255;
    }
}

enum class Format { png, jpeg, exr };

Format formatOf(const fs::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (extension == ".png") return Format::png;
    if (extension == ".jpg" || extension == ".jpeg") return Format::jpeg;
    if (extension == ".exr") return Format::exr;
    throw UsageError(path.string(), "the extension '" + extension + "'", ".png, .jpg or .exr");
}

std::vector<std::uint8_t> bytesFromImage(const fs::path& path, const Image& image) {
    std::vector<std::uint8_t> bytes(image.pixels.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        // Clamping would turn NaN into black without a word.
        if (std::isnan(image.pixels[i])) throw NumericError(path.string(), "NaN in the picture", "numbers");
        bytes[i] = byteFromUnit(image.pixels[i]);
    }
    return bytes;
}

/// The file's bytes. Encoded in memory, because on a full disk OpenImageIO's PNG writer says nothing and its
/// JPEG writer ends the program; writing bytes is ours (atomic_file.h).
std::string encode(const fs::path& path, const ImageSpec& spec, TypeDesc type, const void* data) {
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const std::string name = "picture" + path.extension().string();  // the extension chooses the format
    const std::unique_ptr<ImageOutput> output = ImageOutput::create(name);
    if (!output || !output->set_ioproxy(&memory) || !output->open(name, spec) ||
        !output->write_image(type, data) || !output->close())
        throw IoError(path.string(), firstLine(output ? output->geterror() : OIIO::geterror()),
                      "a picture that can be encoded");
    return {bytes.begin(), bytes.end()};
}

}  // namespace

Photo readPhoto(const fs::path& path) {
    checkEnd(path);
    const std::unique_ptr<ImageInput> input = openImage(path);
    const ImageSpec spec = input->spec();
    const Channels channels = findChannels(spec);
    Photo photo;
    photo.width = spec.width;
    photo.height = spec.height;
    photo.pixels.resize(static_cast<std::size_t>(spec.width) * spec.height);

    // Floating point says linear light; integers say encoded.
    if (spec.format.is_floating_point()) {
        const std::vector<float> values = decode<float>(path, *input, TypeDesc::FLOAT);
        checkFinite(path, spec, values);
        photoFromLinear(values, spec.nchannels, channels, photo);
    } else {
        photoFromBytes(decode<std::uint8_t>(path, *input, TypeDesc::UINT8), spec.nchannels, channels, photo);
    }
    photo.has_alpha = std::any_of(photo.pixels.begin(), photo.pixels.end(), [](const Photo::Pixel& p) { return p[3] < 255; });
    return photo;
}

ImageHeader readImageHeader(const fs::path& path) {
    const std::unique_ptr<ImageInput> input = openImage(path);
    const ImageSpec& spec = input->spec();
    return {spec.width, spec.height, findChannels(spec).alpha >= 0};
}

void layOnWhite(Photo& photo) {
    for (Photo::Pixel& pixel : photo.pixels) {
        const int alpha = pixel[3];
        for (int c = 0; c < 3; ++c)
            pixel[c] = static_cast<std::uint8_t>((pixel[c] * alpha + 255 * (255 - alpha) + 127) / 255);
        pixel[3] = 255;
    }
    photo.has_alpha = false;
}

PhotoOrigin readPhotoOrigin(const fs::path& path) {
    const std::unique_ptr<ImageInput> input = openImage(path);
    const ImageSpec& spec = input->spec();
    PhotoOrigin origin{spec.width, spec.height, {}, spec.get_float_attribute("Exif:FocalLength"), false};
    if (!std::isfinite(origin.focal_length_mm) || origin.focal_length_mm < 0) origin.focal_length_mm = 0;  // x/0
    for (const char* name : {"Make", "Model", "Exif:LensModel"}) {
        const std::string word(spec.get_string_attribute(name));
        if (!word.empty()) origin.camera += (origin.camera.empty() ? "" : " ") + word;
    }
    origin.has_position = spec.find_attribute("GPS:Latitude") && spec.find_attribute("GPS:Longitude");
    return origin;
}

Image readImage(const fs::path& path) {
    checkEnd(path);
    const std::unique_ptr<ImageInput> input = openImage(path);
    const ImageSpec spec = input->spec();
    Image image;
    image.width = spec.width;
    image.height = spec.height;
    image.channels = spec.nchannels;
    image.pixels = decode<float>(path, *input, TypeDesc::FLOAT);
    return image;
}

void writeImage(const fs::path& path, const Image& image) {
    quietenOpenImageIO();
    const Format format = formatOf(path);
    const bool channels_fit =
        image.channels == 1 || image.channels == 3 || (image.channels == 4 && format != Format::jpeg);
    if (image.width <= 0 || image.height <= 0 || !channels_fit)
        throw UsageError(path.string(),
                         "a picture of " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                             " with " + std::to_string(image.channels) + " channels",
                         format == Format::jpeg ? "1 or 3 channels for JPEG" : "1, 3 or 4 channels");

    const TypeDesc type = format == Format::exr ? TypeDesc::FLOAT : TypeDesc::UINT8;
    ImageSpec spec(image.width, image.height, image.channels, type);
    spec.attribute("oiio:ColorSpace", format == Format::exr ? "Linear" : "sRGB");
    spec.attribute("oiio:UnassociatedAlpha", 1);  // our alpha is straight, and PNG's is: write as it is
    if (format == Format::jpeg) spec.attribute("Compression", "jpeg:95");
    if (format == Format::exr) spec.attribute("DateTime", "");  // else the clock's: equal pictures, equal bytes

    const std::vector<std::uint8_t> bytes =
        format == Format::exr ? std::vector<std::uint8_t>() : bytesFromImage(path, image);
    const void* data = format == Format::exr ? static_cast<const void*>(image.pixels.data()) : bytes.data();
    writeAtomically(path, encode(path, spec, type, data));
}

float srgbFromLinear(float linear) {
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

float linearFromSrgb(float srgb) {
    return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

}  // namespace nerfvdb
