// SPDX-License-Identifier: Apache-2.0
// How widely spread along a ray its light is: the distortion loss, one sample at a time, and its derivative.
//
//   D = sum_i sum_j w_i w_j |s_i - s_j|
// Source: Barron et al. 2022, "Mip-NeRF 360", eq. 15, whose second term, the width of the samples themselves, is
// left out: here it is half a voxel for all. Samples come in the order of s, so that sums over those in front and
// those behind take the place of the double sum. Where pictures leave open at which distance something is (a plain
// wall, the space behind what cameras see), it gathers haze into one surface.
#pragma once

namespace nerfvdb {

/// D of a ray, front to back.
struct DistortionRay {
    float weight = 0;    // sum_i w_i
    float moment = 0;    // sum_i w_i s_i
    float spread = 0;    // D

    /// The next sample: its weight and its distance, in units of the caller's, no less than the one before.
    void add(float w, float s) {
        spread += 2 * w * (s * weight - moment);
        weight += w;
        moment += w * s;
    }
};

/// dD_dw_i = 2 sum_j w_j |s_i - s_j|, back to front.
struct DistortionRayBackward {
    float weight_in_front, moment_in_front;
    float weight_behind = 0, moment_behind = 0;

    explicit DistortionRayBackward(const DistortionRay& whole)
        : weight_in_front(whole.weight), moment_in_front(whole.moment) {}

    /// Of the next sample from the back.
    float add(float w, float s) {
        weight_in_front -= w;
        moment_in_front -= w * s;
        const float slope = 2 * ((s * weight_in_front - moment_in_front) + (moment_behind - s * weight_behind));
        weight_behind += w;
        moment_behind += w * s;
        return slope;
    }
};

}  // namespace nerfvdb
