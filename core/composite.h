// SPDX-License-Identifier: Apache-2.0
// The volume-rendering sum, one sample at a time, front to back; and its derivative, back to front.
//
//   tau_i = sigma_i dt,  alpha_i = 1 - exp(-tau_i),  T_i = exp(-sum_{j<i} tau_j),  w_i = T_i alpha_i
//   sum_i w_i + T_end = 1,  T_end = exp(-sum_i tau_i)
// Source: Max 1995, "Optical models for direct volume rendering"; as in Mildenhall et al. 2020, eq. 3.
#pragma once

namespace nerfvdb {

/// Light that is left on a ray; in double, so that its error does not grow with the number of samples.
struct CompositeRay {
    double transmittance = 1;  // T_i in front of the next sample; after the last one, T_end

    /// Weight w_i of a sample with alpha = 1 - exp(-tau) and decay = exp(-tau), both given, so that neither loses
    /// digits: alpha by expm1 where tau is small, decay by exp where it is large. (Below tau = 3e-8 decay is 1 in
    /// single precision: a thousand such samples would weigh something and stop nothing.)
    float add(float alpha, float decay) {
        const double weight = transmittance * alpha;
        transmittance = alpha < 0.5f ? transmittance - weight : transmittance * decay;
        return static_cast<float>(weight);
    }
};

/// The derivative of any loss of weights and T_end. With a_i = dl_dw_i:
///   dl_dtau_i = T_{i+1} a_i - sum_{j>i} w_j a_j - T_end dl_dT_end
/// Nothing is divided by 1 - alpha, nothing overflows. The terms cancel: its error is a few roundings of the sum of
/// their magnitudes, not of the result.
struct CompositeRayBackward {
    float behind;  // sum_{j>i} w_j a_j + T_end dl_dT_end

    CompositeRayBackward(float transmittance_end, float dl_dtransmittance_end)
        : behind(transmittance_end * dl_dtransmittance_end) {}

    /// dl_dtau of the next sample from the back: its weight, the transmittance behind it (T_{i+1}), and dl_dw_i.
    float add(float weight, float transmittance_behind, float dl_dweight) {
        const float dl_dtau = transmittance_behind * dl_dweight - behind;
        behind += weight * dl_dweight;
        return dl_dtau;
    }
};

}  // namespace nerfvdb
