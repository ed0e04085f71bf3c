// SPDX-License-Identifier: Apache-2.0
// Light along a tile of rays: march to occupied cells, read density, composite front to back until the ray is
// opaque, then gather the features of the samples that matter. And all of it backwards.
//
//   tau_i = sigma_i dt,  alpha_i = 1 - exp(-tau_i),  T_i = exp(-sum_{j<i} tau_j),  w_i = T_i alpha_i
//   W = sum_i w_i,  F = sum_i w_i f_i / W,  T_end = exp(-sum_i tau_i)
// Source: Max 1995, "Optical models for direct volume rendering"; Mildenhall et al. 2020, eq. 3.
// Which colour F becomes, and what is behind the scene, is the decoder's and the caller's business.
#pragma once

#include <cstdint>
#include <vector>

#include "core/camera.h"
#include "core/composite.h"
#include "core/distortion.h"
#include "core/simd/kernels.h"
#include "vdb/occupancy.h"
#include "vdb/volume.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// What the thresholds may cost: on any ray, fog included, stopping early changes a colour in [0, 1] by at most
/// stop_transmittance, and dropping weights by at most max_dropped: together 255 (stop_transmittance + max_dropped)
/// levels of 8 bits, 2.6 at the defaults. Where cells below min_alpha are passed by as well (findOccupied), by at most
/// 1 - (1 - min_alpha)^voxels passed more. Proofs, and what a decoder makes of it: docs/stability.md.
struct TraceOptions {
    float step_voxels = 0.5f;          // distance between samples, voxel edges
    float stop_transmittance = 1e-4f;  // a ray ends when less light than this is left
    float min_weight = 1e-3f;          // features of samples below this weight are not read ...
    float max_dropped = 0.01f;         // ... as long as the weights dropped on their ray sum to at most this
    bool skip_unlit = true;            // rays that meet nothing are not decoded
};

/// A field, or a plain volume, and its occupied cells, ready to be traced. Borrows both.
struct TraceScene {
    TraceScene(const VoxelField& field, const Occupancy& occupancy);
    /// Rays are in the volume's own frame (Volume::worldFromGrid is left to the caller); features are colours.
    TraceScene(const Volume& volume, const Occupancy& occupancy);
    Bricks bricks;
    GridFrame frame;      // of shell 0
    Shells shells;
    double density_scale;
    bool holds_sigma;     // the bricks hold sigma itself, not its logarithm
};

/// The reach of a ray's distortion (core/distortion.h) in scenes of so many shells: how far it pulls haze together, in the
/// (inner) box's longest side. In a box less than what a hollow object is wide, for in a hollow without texture it would
/// make a false floor. In places, where distances are logarithms, as good as without end: there haze right before a camera
/// is to be drawn to what is far behind it. Figures: docs/quality.md.
constexpr float distortionReach(int shells) { return shells > 1 ? 8.0f : 0.2f; }

/// What tracing cost.
struct TraceCounters {
    std::uint64_t rays = 0;
    std::uint64_t rays_skipped = 0;      // met no occupied cell
    std::uint64_t samples_dense = 0;     // of a dense march through the box, no early stop
    std::uint64_t samples_density = 0;   // density was read
    std::uint64_t samples_features = 0;  // features were read
    TraceCounters& operator+=(const TraceCounters& other);
};

/// The samples of a tile that carry weight, in order along each ray (rays interleaved); [n] each.
struct KeptSamples {
    int n = 0;
    std::vector<std::int32_t> leaf, cell, ray;
    std::vector<float> x, y, z;             // as in SampleArrays
    std::vector<float> t;                   // distance from where the ray enters the scene, voxels of shell 0
    std::vector<float> weight, tau;
    std::vector<float> transmittance;       // behind the sample, T_{i+1}
    std::vector<float> dl_draw;             // of raw density, or of sigma; filled by traceBackward

    void reserve(std::size_t size);         // makes room, keeps contents
    SampleArrays arrays() { return {leaf.data(), cell.data(), x.data(), y.data(), z.data(), t.data()}; }
};

/// Rays of one tile and what became of them; reused from tile to tile, so that nothing is allocated in the loop.
/// Threads: one each.
class RayTracer {
public:
    explicit RayTracer(int max_rays);

    /// Starts a new tile.
    void clear() { n_rays_ = 0; }
    /// Adds a ray (world space); its first sample lies `jitter` steps (0..1) behind the entry into each shell, and each
    /// stretch of a layer.
    void addRay(const TraceScene& scene, const Ray& ray, float step_voxels, float jitter);
    int rayCount() const { return n_rays_; }

    /// Traces the tile; fills `kept`, transmittance() and rayFeatures().
    void trace(const TraceScene& scene, const TraceOptions& options, KeptSamples& kept);

    /// Gradient of the kept samples' interpolated densities (kept.dl_draw), given dl_dF [ray][channels] and dl_dT_end [ray]:
    /// CompositeRayBackward with dl_dw_i = (f_i - F) . dl_dF / W + dl_dD dD_dw_i, where D is the ray's distortion,
    /// distances in the (inner) box's longest side, beyond which they grow with the logarithm, of distortionReach. The
    /// gradient of features is linear and left to leaf_scatter.h: dl_df_i = w_i (dl_dF / W). For it, dl_dray_features
    /// holds dl_dF / W afterwards.
    void traceBackward(const TraceScene& scene, float* dl_dray_features, const float* dl_dtransmittance,
                       float dl_ddistortion, KeptSamples& kept);
    /// D of the tile's rays, summed; of the last traceBackward.
    double distortion() const { return distortion_; }

    /// Rays that met something, in order (all, without skip_unlit). The others show what is behind the scene.
    const std::vector<std::int32_t>& litRays() const { return lit_; }
    const float* transmittance() const { return transmittance_.data(); }  // [ray] T_end
    float* rayFeatures() { return ray_features_.data(); }                 // [ray][channels] F, 0 if nothing was kept
    const float* weight() const { return weight_.data(); }                // [ray] W
    const float* directions() const { return directions_.data(); }        // [ray][3] unit, world
    /// Distance from the camera to the ray's entry into the scene, voxels of shell 0; add KeptSamples::t. [ray]
    const float* entry() const { return entry_.data(); }
    const TraceCounters& counters() const { return counters_; }
    void resetCounters() { counters_ = {}; }

private:
    void averageFeatures(int channels, const KeptSamples& kept);
    void addFeatureSlopes(int channels, float* dl_dray_features, const KeptSamples& kept);
    void addDistortionSlopes(const TraceScene& scene, float dl_ddistortion, const KeptSamples& kept);

    /// The way of a ray through space that one layer, or one shell, owns; distances along the ray, voxels of shell 0.
    struct Way {
        Vec3d origin, direction;  // of the ray, index coordinates of shell 0
        double t_entry;           // into the scene
        float offset;             // of the first sample
    };
    void addStretch(const TraceScene& scene, int layer, const Way& way, double t_begin, double t_end);
    void addStretches(const TraceScene& scene, int shell, const Way& way, double t_begin, double t_end);

    int n_rays_ = 0;
    // A ray goes in stretches, each straight through one layer in that layer's index space; [stretch] ...
    int n_stretches_ = 0;
    std::vector<float> ox_, oy_, oz_, dx_, dy_, dz_, length_, offset_;
    std::vector<float> scale_, t_begin_;              // distance on the ray = t_begin + scale * distance in the layer
    std::vector<std::int32_t> next_, ray_;
    std::vector<std::int32_t> first_stretch_;         // ... [ray + 1]
    std::vector<float> entry_, directions_;
    std::vector<std::int32_t> alive_, begin_, lit_;
    std::vector<std::uint8_t> has_met_;               // [ray] an occupied cell
    std::vector<double> light_;                       // [ray] T in front of the next sample
    std::vector<float> transmittance_, dropped_, ray_features_, weight_, inverse_weight_;
    std::vector<std::int32_t> leaf_, cell_;
    std::vector<float> x_, y_, z_, t_, raw_, tau_, alpha_, decay_;
    std::vector<float> features_, slope_, mean_slope_;
    std::vector<CompositeRayBackward> behind_;
    std::vector<DistortionScan> spread_;
    std::vector<float> last_distance_, distance_decay_, decay_behind_;
    float tau_scale_ = 0;  // tau per sigma
    double distortion_ = 0;
    TraceCounters counters_;
};

}  // namespace nerfvdb
