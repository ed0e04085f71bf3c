// SPDX-License-Identifier: Apache-2.0
#include "trainer/mask.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"

namespace nerfvdb {
namespace {

namespace fs = std::filesystem;

// Masks are written as 0 and 255; what lies between is the ringing of JPEG or a softened edge.
constexpr int kCounts = 128;

std::string sizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// True if one size is the other scaled and rounded to whole pixels, up or down.
bool sameAspect(int width, int height, int other_width, int other_height) {
    const double scale = static_cast<double>(other_width) / width;
    return std::abs(other_height - height * scale) < std::max(1.0, scale);
}

/// The file of that name, or with .png in place of or after its extension; empty if there is none.
fs::path maskNamed(const fs::path& name) {
    for (const fs::path& path : {fs::path(name).replace_extension(".png"), fs::path(name.string() + ".png"), name})
        if (fs::is_regular_file(path)) return path;
    return {};
}

}  // namespace

fs::path findMask(const fs::path& image, const fs::path& folder) {
    static const std::set<fs::path> kSplits{"train", "val", "test"};
    fs::path above = (folder.empty() ? fs::path(".") : folder).lexically_normal();
    const fs::path photograph = image.lexically_normal();
    fs::path below = photograph.lexically_relative(above);
    if (below.empty() || *below.begin() == "..") {  // photographs elsewhere: beside the folder that holds them
        above = photograph.parent_path().parent_path();
        below = photograph.lexically_relative(above);
    }
    for (;;) {
        if (const fs::path mask = maskNamed(above / "masks" / below); !mask.empty()) return mask;
        if (!below.has_parent_path()) return {};
        const fs::path first = *below.begin();
        below = below.lexically_relative(first);
        // Splits use the same names for different photographs.
        if (kSplits.count(first) == 0)
            if (const fs::path mask = maskNamed(above / "masks" / below); !mask.empty()) return mask;
        above /= first;
    }
}

PixelMask readMask(const fs::path& path, int width, int height, bool& was_scaled) {
    const Photo photo = readPhoto(path);
    if (!sameAspect(photo.width, photo.height, width, height))
        throw DataError(path.string(), "a mask of " + sizeText(photo.width, photo.height) + " pixels",
                        sizeText(width, height) + " as its photograph, or another size of that aspect",
                        "make it anew, or use --no-masks");
    was_scaled = photo.width != width || photo.height != height;
    PixelMask mask(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int from_x = static_cast<int>((2LL * x + 1) * photo.width / (2LL * width));
            const int from_y = static_cast<int>((2LL * y + 1) * photo.height / (2LL * height));
            const auto& pixel = photo.pixels[static_cast<std::size_t>(from_y) * photo.width + from_x];
            if (std::max({pixel[0], pixel[1], pixel[2]}) >= kCounts) mask.keep(x, y);
        }
    if (mask.count() == 0)
        throw DataError(path.string(), "a mask that hides the whole photograph",
                        "white where pixels count, black where they do not",
                        "leave out the photograph, correct the mask, or use --no-masks");
    return mask;
}

void maskByAlpha(Photo& photo, PixelMask& mask, const fs::path& path) {
    if (!photo.has_alpha) return;
    PixelMask both(photo.width, photo.height);
    for (int y = 0; y < photo.height; ++y)
        for (int x = 0; x < photo.width; ++x) {
            std::uint8_t& alpha = photo.pixels[static_cast<std::size_t>(y) * photo.width + x][3];
            if (alpha >= kCounts && mask.counts(x, y)) both.keep(x, y);
            alpha = 255;
        }
    photo.has_alpha = false;
    if (both.count() == 0)
        throw DataError(path.string(), "alpha that, as a mask, leaves no pixel", "pixels that are half opaque and more",
                        "leave out the photograph, or do without --alpha-masks");
    mask = std::move(both);
}

}  // namespace nerfvdb
