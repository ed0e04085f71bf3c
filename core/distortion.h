// SPDX-License-Identifier: Apache-2.0
// How widely spread along a ray its light is: the distortion loss, one sample at a time, and its derivative.
//
//   D = sum_i sum_j w_i w_j d(|s_i - s_j|),   d(s) = reach (1 - exp(-s / reach))
// Source: Barron et al. 2022, "Mip-NeRF 360", eq. 15, which has d(s) = s, and a second term, the width of the samples
// themselves, that is left out: here it is half a voxel for all. Where pictures leave open at which distance something
// is (a plain wall, the space behind what cameras see), it gathers haze into one surface. With d(s) = s haze is drawn to
// its middle, wherever the surface may be; beyond its reach this distance says that light is apart, but pulls no further.
#pragma once

namespace nerfvdb {

/// Goes along a ray, front to back or back to front, and sums over what it has passed. Sums are single precision: the
/// distance of what is near errs by 6e-8 of the reach.
struct DistortionScan {
    float weight = 0;  // sum_j w_j
    float near = 0;    // sum_j w_j exp(-|s_j - s| / reach), s the last sample's

    /// The next sample: its weight, and exp(-gap / reach), the gap between it and the one before (of the first: anything
    /// finite). Returns sum_j w_j d(|s_j - s|) / reach over those before.
    float add(float w, float decay) {
        near *= decay;
        const float apart = weight - near;
        weight += w;
        near += w;
        return apart;
    }
};

}  // namespace nerfvdb
