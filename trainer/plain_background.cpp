// SPDX-License-Identifier: Apache-2.0
#include "trainer/plain_background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "core/photo_cache.h"

namespace nerfvdb {
namespace {

constexpr double kMostOfViews = 0.9;  // some may be close-ups

/// A line around a picture, and how much of it shows the background: an object may reach over the edge, and what undistorting
/// a photograph leaves black along its border is not wide.
struct Line {
    double inset;  // of the picture's size
    double least;
};
constexpr Line kLines[] = {{0, 0.9}, {0.1, 0.6}};

/// Calls use(pixel) with each pixel of a line that counts.
template <typename Use>
void forEachPixel(const View& view, const Line& line, const Use& use) {
    const Photo& photo = view.photo;
    const int left = static_cast<int>(line.inset * photo.width), right = photo.width - 1 - left;
    const int top = static_cast<int>(line.inset * photo.height), bottom = photo.height - 1 - top;
    const auto look = [&](int x, int y) {
        if (view.mask.counts(x, y)) use(photo.at(x, y));
    };
    for (int x = left; x <= right; ++x) look(x, top), look(x, bottom);
    for (int y = top + 1; y < bottom; ++y) look(left, y), look(right, y);
    releasePages(photo);
}

bool isOff(const Photo::Pixel& pixel, const Vec3f& colour) {
    for (int c = 0; c < 3; ++c)
        if (std::abs(static_cast<float>(pixel[c]) / 255 - colour[c]) > kPlainTolerance) return true;
    return false;
}

/// Whether a photograph has a background of this colour; nothing when no pixel counts.
std::optional<bool> isBefore(const View& view, const Vec3f& colour) {
    bool has_any = false;
    for (const Line& line : kLines) {
        std::size_t n_alike = 0, n_pixels = 0;
        forEachPixel(view, line, [&](const Photo::Pixel& pixel) {
            n_alike += !isOff(pixel, colour);
            ++n_pixels;
        });
        if (static_cast<double>(n_alike) < line.least * static_cast<double>(n_pixels)) return false;
        has_any |= n_pixels > 0;
    }
    return has_any ? std::optional(true) : std::nullopt;
}

}  // namespace

std::optional<Vec3f> plainBackground(const Dataset& dataset) {
    if (std::any_of(dataset.views.begin(), dataset.views.end(),
                    [](const View& view) { return view.camera.distortion.model == LensModel::fisheye; }))
        return std::nullopt;
    std::array<std::array<std::uint64_t, 256>, 3> counts{};
    std::uint64_t total = 0;
    for (const View& view : dataset.views)
        forEachPixel(view, kLines[0], [&](const Photo::Pixel& pixel) {
            for (int c = 0; c < 3; ++c) ++counts[c][pixel[c]];
            ++total;
        });
    if (total == 0) return std::nullopt;
    Vec3f colour;
    for (int c = 0; c < 3; ++c) {
        int median = 0;
        for (std::uint64_t below = counts[c][0]; 2 * below <= total; below += counts[c][median]) ++median;
        colour[c] = static_cast<float>(median) / 255;
    }

    std::size_t n_plain = 0, n_views = 0;
    for (const View& view : dataset.views)
        if (const std::optional<bool> is_plain = isBefore(view, colour)) {
            ++n_views;
            n_plain += *is_plain;
        }
    if (static_cast<double>(n_plain) < kMostOfViews * static_cast<double>(n_views)) return std::nullopt;
    return colour;
}

}  // namespace nerfvdb
