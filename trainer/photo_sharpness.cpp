// SPDX-License-Identifier: Apache-2.0
#include "trainer/photo_sharpness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/median.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kDistances = 4;                      // 1, 2, 4 and 8 pixels, ...
constexpr int kFarthest = 1 << kDistances;         // ... each held against twice as many
constexpr double kResolved = 0.65;
constexpr std::size_t kViews = 15;
constexpr double kSamples = 65536;                 // of a photograph

int brightness(const Photo::Pixel& pixel) { return pixel[0] + pixel[1] + pixel[2]; }

/// Of one photograph; 0 if it is too small, or of one colour.
double resolvedPixels(const Photo& photo) {
    const int width = photo.width - kFarthest, height = photo.height - kFarthest;
    if (width <= 0 || height <= 0) return 0;
    const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / kSamples)));
    std::array<double, kDistances + 1> squares{};
    for (int y = 0; y < height; y += stride)
        for (int x = 0; x < width; x += stride) {
            const int here = brightness(photo.at(x, y));
            for (int n = 0; n <= kDistances; ++n) {
                const double across = brightness(photo.at(x + (1 << n), y)) - here;
                const double down = brightness(photo.at(x, y + (1 << n))) - here;
                squares[n] += across * across + down * down;
            }
        }
    if (squares[kDistances] == 0) return 0;
    int n = 0;
    while (n + 1 < kDistances && squares[n] < kResolved * kResolved * squares[n + 1]) ++n;
    return 1 << n;
}

}  // namespace

double resolvedPixels(const Dataset& dataset) {
    const std::size_t stride = std::max<std::size_t>(1, dataset.views.size() / kViews);
    std::vector<double> found((dataset.views.size() + stride - 1) / stride);
    parallelFor(found.size(), [&](std::size_t i) { found[i] = resolvedPixels(dataset.views[i * stride].photo); });
    std::erase(found, 0.0);
    if (found.empty()) return 1;
    return medianOf(std::move(found));
}

}  // namespace nerfvdb
