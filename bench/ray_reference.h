// SPDX-License-Identifier: Apache-2.0
// A ray's light and its derivative in long double, from the definitions of vdb/ray_tracer.h, with nothing
// skipped, dropped or stopped early: the judge of the fast one. Shares no arithmetic with it, only the bricks
// that it reads.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vdb/ray_tracer.h"

namespace nerfvdb {

using Exact = long double;  // 64 bits of fraction on x86

/// A sample where it lies: as the march found it, or as it should have.
struct ExactSample {
    std::int32_t leaf = 0, cell = 0;
    Exact x = 0, y = 0, z = 0;  // inside the cell
    Exact t = 0;                // from the entry into the box, voxels
};

/// A ray in index space, from where it enters the box to where it leaves it.
class ExactMarch {
public:
    ExactMarch(const TraceScene& scene, const Ray& ray, float step_voxels, float jitter);

    bool hits() const { return length_ > 0; }
    Exact length() const { return length_; }  // inside the box, voxels
    Exact entry() const { return entry_; }    // from the ray's origin to the box, voxels
    Exact t(std::int64_t k) const { return static_cast<Exact>(offset_) + static_cast<Exact>(k) * step_; }
    Exact position(std::int64_t k, int axis) const { return origin_[axis] + direction_[axis] * t(k); }
    /// Distance of sample k from the nearest plane between cells, voxels.
    Exact faceDistance(std::int64_t k) const;
    /// Sample k if its cell is occupied.
    std::optional<ExactSample> sample(std::int64_t k) const;
    /// How far the ray's end lies behind its last sample, in steps, 0..1.
    Exact endPhase() const;
    /// All samples of the ray in occupied cells.
    std::vector<ExactSample> samples() const;

private:
    const TraceScene& scene_;
    Exact origin_[3], direction_[3];
    Exact length_ = 0, entry_ = 0;
    float step_, offset_;
};

/// What ray_tracer.h defines, per sample and per ray.
struct ExactLight {
    std::vector<Exact> tau, weight, behind;  // [sample] tau_i, w_i, T_{i+1}
    std::vector<Exact> features;             // [sample][channels]
    std::vector<Exact> mean;                 // [channels] F
    Exact transmittance = 1;                 // T_end
    Exact weight_sum = 0;                    // W
    Exact depth = 0;                         // mean t, voxels from the entry
};
ExactLight exactLight(const TraceScene& scene, float step_voxels, const std::vector<ExactSample>& samples);

/// dl_draw of each sample and the sum of the magnitudes of the terms that it is made of.
struct ExactGradient {
    std::vector<Exact> dl_draw, magnitude;
    Exact largest_slope = 0;  // the largest |dl_dw_i| by magnitudes, and |dl_dT_end|
};
ExactGradient exactGradient(const TraceScene& scene, const std::vector<ExactSample>& samples,
                            const ExactLight& light, const std::vector<float>& dl_dmean,
                            float dl_dtransmittance, float dl_ddistortion);

}  // namespace nerfvdb
