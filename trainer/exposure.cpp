// SPDX-License-Identifier: Apache-2.0
#include "trainer/exposure.h"

#include <algorithm>
#include <cmath>

namespace nerfvdb {
namespace {

// Of the loss, per squared number, in the units of a view's mean squared error summed over channels: a photograph that
// needs no correction gets none for the sake of its noise.
constexpr float kTowardsIdentity = 1e-3f;

}  // namespace

Exposure Exposures::of(int view) const {
    Exposure exposure;
    if (!learned()) return exposure;
    const float* const values = &values_[static_cast<std::size_t>(view) * kValues];
    std::copy_n(values, 9, exposure.matrix.begin());
    std::copy_n(values + 9, 3, exposure.offset.begin());
    return exposure;
}

void Exposures::addGradient(std::span<const ExposedRay> rays, std::span<double> dl_dvalues) const {
    for (const ExposedRay& ray : rays) {
        double* const sum = &dl_dvalues[static_cast<std::size_t>(ray.view) * kValues];
        for (int r = 0; r < 3; ++r) {
            const double slope = ray.dl_dcolor[r];
            for (int c = 0; c < 3; ++c) sum[3 * r + c] += slope * ray.light[c];
            sum[9 + r] += slope * ray.coverage;
        }
    }
}

void Exposures::step(std::span<const double> dl_dvalues, std::uint64_t n_rays, float rate) {
    // A view's share of the batch, as if each view had a batch of its own.
    const float scale = static_cast<float>(static_cast<double>(viewCount()) / static_cast<double>(n_rays));
    slopes_.resize(values_.size());
    for (std::size_t i = 0; i < slopes_.size(); ++i)
        slopes_[i] = scale * static_cast<float>(dl_dvalues[i]) + 2 * kTowardsIdentity * values_[i];
    adam_.step(values_, slopes_, rate);

    for (std::size_t k = 0; k < kValues; ++k) {
        double mean = 0;
        for (std::size_t i = k; i < values_.size(); i += kValues) mean += values_[i];
        mean /= static_cast<double>(viewCount());
        for (std::size_t i = k; i < values_.size(); i += kValues) values_[i] -= static_cast<float>(mean);
    }
}

std::vector<double> Exposures::gains() const {
    constexpr float kGrey[3] = {0.5f, 0.5f, 0.5f};
    std::vector<double> gains;
    for (std::size_t view = 0; view < viewCount(); ++view) {
        float shown[3];
        of(static_cast<int>(view)).forward(kGrey, 1, shown);
        gains.push_back((static_cast<double>(shown[0]) + shown[1] + shown[2]) / 1.5);
    }
    return gains;
}

double Exposures::ownSpread(std::span<const int> neighbour) const {
    constexpr double kUpperQuartile = 1.627;  // of |a - b|, a and b normal: 1.150 sqrt(2), in standard deviations
    if (!learned()) return 0;
    const std::vector<double> gain = gains();
    std::vector<double> differences;
    for (std::size_t view = 0; view < gain.size(); ++view)
        differences.push_back(std::abs(gain[view] - gain[static_cast<std::size_t>(neighbour[view])]));
    const auto quartile = differences.begin() + static_cast<std::ptrdiff_t>(3 * differences.size() / 4);
    std::nth_element(differences.begin(), quartile, differences.end());
    return *quartile / kUpperQuartile;
}

}  // namespace nerfvdb
