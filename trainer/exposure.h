// SPDX-License-Identifier: Apache-2.0
// What exposure and white balance did to each photograph: an affine map of its colours, learned with the scene, so that
// the scene need not change its colour from view to view.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/optimizer.h"

namespace nerfvdb {

/// How one photograph shows light: colour = (I + matrix) light + offset * coverage, on sRGB values. Coverage is the
/// share of the pixel that the camera exposed, 1 but where alpha says less; light is premultiplied by it.
struct Exposure {
    std::array<float, 9> matrix{};  // rows; what differs from the identity
    std::array<float, 3> offset{};

    /// light[3] -> color[3].
    void forward(const float* light, float coverage, float* color) const {
        for (int r = 0; r < 3; ++r)
            color[r] = light[r] + (matrix[3 * r] * light[0] + matrix[3 * r + 1] * light[1] +
                                   matrix[3 * r + 2] * light[2] + offset[r] * coverage);
    }
    /// dl_dcolor[3] -> dl_dlight[3]; returns dl_dcoverage.
    float backward(const float* dl_dcolor, float* dl_dlight) const {
        for (int c = 0; c < 3; ++c)
            dl_dlight[c] = dl_dcolor[c] + (matrix[c] * dl_dcolor[0] + matrix[3 + c] * dl_dcolor[1] +
                                           matrix[6 + c] * dl_dcolor[2]);
        return offset[0] * dl_dcolor[0] + offset[1] * dl_dcolor[1] + offset[2] * dl_dcolor[2];
    }
};

/// A ray's part in the gradient of its photograph's exposure.
struct ExposedRay {
    int view;
    float light[3], coverage;
    float dl_dcolor[3];
};

/// The exposures of all photographs. An affine map per image as in Rematas et al. 2022, "Urban Radiance Fields", there
/// read from a latent code by a network, here held as its twelve numbers. Scene and exposures could trade any common
/// map between them; the mean over the photographs is kept at the identity, so the model shows the mean exposure, and
/// that is also what photographs are compared with which training never saw.
class Exposures {
public:
    static constexpr int kValues = 12;  // of one photograph: matrix, offset

    /// None are learned: every photograph shows light as it is.
    Exposures() = default;
    /// The identity for each of so many photographs. `with_background`: what is behind the scene was exposed too, as
    /// in photographs without alpha.
    Exposures(std::size_t n_views, bool with_background)
        : values_(n_views * kValues), with_background_(with_background) {}

    bool learned() const { return !values_.empty(); }
    bool withBackground() const { return with_background_; }
    std::size_t viewCount() const { return values_.size() / kValues; }
    Exposure of(int view) const;
    std::span<float> values() { return values_; }  // [view][kValues]: matrix - I by rows, offset

    /// Adds the gradient of these rays' summed loss, one ray after the other, to dl_dvalues [view][kValues].
    void addGradient(std::span<const ExposedRay> rays, std::span<double> dl_dvalues) const;

    /// One step of Adam on the mean loss of a batch of `n_rays`, drawn towards the identity, then centred again.
    void step(std::span<const double> dl_dvalues, std::uint64_t n_rays, float rate);

    /// How bright each photograph shows a mid grey of the scene, 1 as it is; [view].
    std::vector<double> gains() const;
    /// How much of its gain is a photograph's own, not shared with `neighbour[view]` (nearestViews): the standard deviation of
    /// independent normal gains whose differences' upper quartile is theirs. A camera that follows the light as it goes has
    /// little, in spite of some leaps.
    double ownSpread(std::span<const int> neighbour) const;

    /// What a checkpoint keeps, in its order.
    template <typename Visitor>
    void visit(Visitor& visitor) {
        visitor.values(values_);
        visitor.value(with_background_);
        visitor.values(adam_.first);
        visitor.values(adam_.second);
        visitor.value(adam_.count);
    }

private:
    std::vector<float> values_;
    bool with_background_ = true;
    Adam adam_;
    std::vector<float> slopes_;  // working memory of step
};

}  // namespace nerfvdb
