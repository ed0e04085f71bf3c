// SPDX-License-Identifier: Apache-2.0
#include "vdb/block_renderer.h"

#include <cmath>

#include "core/error.h"

namespace nerfvdb {
namespace {

/// sum += weight * image, value by value.
void add(Image& sum, const Image& image, float weight) {
    for (std::size_t i = 0; i < sum.pixels.size(); ++i) sum.pixels[i] += weight * image.pixels[i];
}

/// The same, each pixel's weight times its opacity.
void addByOpacity(Image& sum, const Image& image, const Image& opacity, float weight) {
    const auto channels = static_cast<std::size_t>(sum.channels);
    for (std::size_t i = 0; i < sum.pixels.size(); ++i)
        sum.pixels[i] += weight * opacity.pixels[i / channels] * image.pixels[i];
}

bool isAlike(const Image& a, const Image& b) {
    return a.width == b.width && a.height == b.height && a.channels == b.channels;
}

}  // namespace

RenderedImage blendPictures(std::span<const RenderedImage> pictures, std::span<const double> weights) {
    if (pictures.empty() || pictures.size() != weights.size())
        throw UsageError("blending", std::to_string(pictures.size()) + " pictures and " +
                                         std::to_string(weights.size()) + " weights",
                         "at least one, and as many of each");
    const RenderedImage& first = pictures.front();
    const auto empty = [](const Image& like) { return Image(like.width, like.height, like.channels); };
    RenderedImage blend{empty(first.rgb), empty(first.opacity), empty(first.depth), empty(first.normal), {}};
    // Of those that have a depth: a ray may have opacity, but nothing that is kept.
    Image placed = empty(first.depth);
    for (std::size_t p = 0; p < pictures.size(); ++p) {
        const RenderedImage& picture = pictures[p];
        if (!isAlike(picture.rgb, first.rgb) || !isAlike(picture.normal, first.normal))
            throw UsageError("blending", "pictures of different sizes", "pictures of one view");
        const auto weight = static_cast<float>(weights[p]);
        add(blend.rgb, picture.rgb, weight);
        add(blend.opacity, picture.opacity, weight);
        addByOpacity(blend.depth, picture.depth, picture.opacity, weight);
        for (std::size_t i = 0; i < placed.pixels.size(); ++i)
            if (picture.depth.pixels[i] > 0) placed.pixels[i] += weight * picture.opacity.pixels[i];
        addByOpacity(blend.normal, picture.normal, picture.opacity, weight);
        blend.counters += picture.counters;
    }
    for (std::size_t i = 0; i < placed.pixels.size(); ++i)
        if (placed.pixels[i] > 0) blend.depth.pixels[i] /= placed.pixels[i];
    for (std::size_t i = 0; i + 2 < blend.normal.pixels.size(); i += 3) {
        float* normal = &blend.normal.pixels[i];
        const float length = std::hypot(normal[0], normal[1], normal[2]);
        if (length > 0)
            for (int c = 0; c < 3; ++c) normal[c] /= length;
    }
    return blend;
}

}  // namespace nerfvdb
