// SPDX-License-Identifier: Apache-2.0
// From what a ray gathered to a colour, once per ray ("deferred decoding"):
//   rgb = sigmoid(F[0..2] + MLP(F, Y(direction), A))     F = sum_i w_i f_i / W,  Y = spherical harmonics, degree < 4
//   C   = A rgb + (1 - A) background                      A = 1 - T_end,  W = sum_i w_i of what was kept
// F is a mean, so that a surface has the same colour where a pixel sees only a part of it; A tells the network where
// that is so, since sRGB values of what is thinner than a pixel do not mix as light does.
// A part that can be exchanged: nothing else knows how features become colour.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mlp.h"
#include "core/types.h"

namespace nerfvdb {

inline constexpr int kDecoderWidth = 128;     // of the network's two hidden layers ...
inline constexpr int kMaxDecoderWidth = 1024;  // ... and the most that is allowed

class Decoder {
public:
    Decoder() = default;
    /// `channels` features per voxel: 4, 8 or 16; the first three are the base colour before the sigmoid.
    Decoder(int channels, std::uint64_t seed, int width = kDecoderWidth);

    /// Sets the network's last layer to zero: until it learns, rgb = sigmoid(F[0..2]) from everywhere. Hidden layers, and what
    /// of features only they read, learn from the second step on.
    void clearOutputLayer();

    int channels() const { return channels_; }
    int width() const { return shape_.widths[1]; }
    const MlpShape& shape() const { return shape_; }
    std::span<float> parameters() { return parameters_; }
    std::span<const float> parameters() const { return parameters_; }

    /// Working memory of one batch; one per thread.
    struct Workspace {
        MlpShape shape;  // that it has room for
        MlpActivations activations, gradients;
        std::vector<float> rgb;  // [3][stride]
    };

    /// Shapes: features [row][channels], direction [row][3] (unit, world, the way light is looked along),
    ///         transmittance [row] T_end (null: all rays are opaque)
    ///         -> rgb [row][3] in (0, 1), sRGB values. Kept in the workspace for backward.
    /// Done for the n rows whose numbers stand in `rows`, others are not touched; null: for the first n.
    void forward(int n, const float* features, const float* direction, const float* transmittance, float* rgb,
                 Workspace& work, const std::int32_t* rows = nullptr) const;

    /// dl_drgb [row][3] -> dl_dfeatures [row][channels] (overwritten), dl_dtransmittance [row] (added to; or null),
    /// dl_dparameters (added to). The same n and rows as in forward.
    void backward(int n, const float* dl_drgb, float* dl_dfeatures, float* dl_dtransmittance,
                  std::span<float> dl_dparameters, Workspace& work, const std::int32_t* rows = nullptr) const;

    /// Colour without view-dependence: rgb of forward averaged over directions spread evenly on the sphere, opaque.
    /// features [n][channels] -> rgb [n][3], sRGB values. What plain renderers and meshes get.
    void diffuse(int n, const float* features, float* rgb) const;

private:
    int channels_ = 0;
    MlpShape shape_;
    std::vector<float> parameters_;
};

}  // namespace nerfvdb
