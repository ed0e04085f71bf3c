// SPDX-License-Identifier: Apache-2.0
// A capture by a camera on automatic: opaque photographs, each with a gain, a white balance and an offset of its own.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/support/random_field.h"
#include "trainer/dataset.h"

namespace nerfvdb::test {

/// What each photograph's channels are multiplied with, and what is added: gains 0.7 to 1.4 with channels 8 % apart,
/// offsets of 0.05, so centred that their means over the photographs are 1 and 0.
inline std::vector<std::array<double, 6>> randomExposures(std::size_t n_views) {
    std::vector<std::array<double, 6>> exposures(n_views);
    std::array<double, 6> mean{};
    for (std::size_t v = 0; v < n_views; ++v) {
        const double gain = 0.7 * std::exp2(static_cast<double>(randomIn(0, 1, 50, v)));
        for (int c = 0; c < 3; ++c) {
            exposures[v][c] = gain * static_cast<double>(randomIn(0.92f, 1.08f, 51, 3 * v + c));
            exposures[v][3 + c] = static_cast<double>(randomIn(-0.05f, 0.05f, 52, 3 * v + c));
        }
        for (int k = 0; k < 6; ++k) mean[k] += exposures[v][k] / static_cast<double>(n_views);
    }
    for (auto& exposure : exposures)
        for (int k = 0; k < 6; ++k) exposure[k] += (k < 3 ? 1 : 0) - mean[k];
    return exposures;
}

/// The photographs before a wall of one colour, without alpha, dark enough that no gain of randomExposures clips.
/// `exposures`: one for each photograph, or none.
inline Dataset exposed(Dataset dataset, const std::vector<std::array<double, 6>>& exposures) {
    constexpr double kWall[3] = {0.45, 0.6, 0.7};
    dataset.has_alpha = false;
    for (std::size_t v = 0; v < dataset.views.size(); ++v) {
        Photo& photo = dataset.views[v].photo;
        photo.has_alpha = false;
        for (auto& pixel : photo.pixels) {
            const double alpha = pixel[3] / 255.0;
            for (int c = 0; c < 3; ++c) {
                double value = 0.1 + 0.58 * (alpha * pixel[c] / 255.0 + (1 - alpha) * kWall[c]);
                if (!exposures.empty()) value = value * exposures[v][c] + exposures[v][3 + c];
                pixel[c] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
            }
            pixel[3] = 255;
        }
    }
    return dataset;
}

}  // namespace nerfvdb::test
