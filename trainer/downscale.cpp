// SPDX-License-Identifier: Apache-2.0
#include "trainer/downscale.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nerfvdb {
namespace {

/// Linear light of each 8-bit sRGB value.
std::array<float, 256> linearTable() {
    std::array<float, 256> table;
    for (int value = 0; value < 256; ++value) table[value] = linearFromSrgb(static_cast<float>(value) / 255.0f);
    return table;
}

std::uint8_t byteFromUnit(double value) {
    return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
}

}  // namespace

Camera downscaled(const Camera& camera, int n) {
    Camera small = camera;
    small.width = camera.width / n;
    small.height = camera.height / n;
    for (double* length : {&small.fx, &small.fy, &small.cx, &small.cy}) *length /= n;
    return small;
}

// Means of sRGB values, as most tools take them, darken what is fine and bright (a fence against the sky, the glints on
// water), and differently at each n. Means of light do not: the file's values are decoded, averaged and encoded once.
Photo downscaled(const Photo& photo, int n) {
    static const std::array<float, 256> kLinear = linearTable();
    Photo small;
    small.width = photo.width / n;
    small.height = photo.height / n;
    small.has_alpha = photo.has_alpha;
    small.pixels.resize(static_cast<std::size_t>(small.width) * small.height);
    for (int y = 0; y < small.height; ++y)
        for (int x = 0; x < small.width; ++x) {
            double light[3] = {}, alpha = 0;
            for (int dy = 0; dy < n; ++dy)
                for (int dx = 0; dx < n; ++dx) {
                    const auto& pixel =
                        photo.pixels[static_cast<std::size_t>(y * n + dy) * photo.width + (x * n + dx)];
                    for (int c = 0; c < 3; ++c)
                        light[c] += static_cast<double>(kLinear[pixel[c]]) * pixel[3];
                    alpha += pixel[3];
                }
            auto& mean = small.pixels[static_cast<std::size_t>(y) * small.width + x];
            for (int c = 0; c < 3; ++c)
                mean[c] = alpha > 0 ? byteFromUnit(srgbFromLinear(static_cast<float>(light[c] / alpha))) : 0;
            mean[3] = byteFromUnit(alpha / (255.0 * n * n));
        }
    return small;
}

PixelMask downscaled(const PixelMask& mask, int n) {
    if (mask.empty()) return {};
    PixelMask small(mask.width() / n, mask.height() / n);
    for (int y = 0; y < small.height(); ++y)
        for (int x = 0; x < small.width(); ++x) {
            bool counts = true;
            for (int i = 0; i < n * n; ++i) counts = counts && mask.counts(x * n + i % n, y * n + i / n);
            if (counts) small.keep(x, y);
        }
    return small;
}

}  // namespace nerfvdb
