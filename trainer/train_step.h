// SPDX-License-Identifier: Apache-2.0
// One step of learning on one level: draw rays, trace, decode, compare, and all of it backwards into the voxels.
// The state of a level and everything that a checkpoint must keep.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/optimizer.h"
#include "trainer/exposure.h"
#include "trainer/ray_source.h"
#include "vdb/decoder.h"
#include "vdb/leaf_scatter.h"
#include "vdb/ray_tracer.h"
#include "vdb/sky.h"

namespace nerfvdb {

/// Voxels are pulled towards their neighbours at every so many steps, as many times as far: what neighbours hold is a third
/// of all that an update reads.
inline constexpr int kSmoothEvery = 4;

/// What is behind the scene where nothing hides it.
enum class Behind : std::uint8_t {
    fixed,   // the background, which is a guess, or stands behind photographs with alpha
    random,  // a random colour behind every other ray, the background behind the rest: photographs with alpha
    plain,   // the background, as photographs show it: a pixel of its colour shows nothing else
};

/// Of the loss, per opacity of a ray whose pixel shows just the plain background: fog of its colour, which no photograph
/// contradicts, goes away. The gradient falls with transmittance: what is opaque, and has the background's colour, stays.
inline constexpr float kPlainOpacity = 0.3f;

inline constexpr float kDistortion = 0.02f;  // of the loss, per unit of RayTracer::distortion; what training grows it to

/// Of the loss, per squared difference of a ray's opacity and its pixel's alpha, where photographs have alpha. Random colours
/// behind rays say the same, but one ray at a time and with their noise.
inline constexpr float kAlpha = 1;

inline constexpr float kEntropy = 0.01f;  // of the loss, per opacityEntropy of a ray; what training shrinks to 0

/// How far parameters move in one step.
struct StepRates {
    float density = 0.2f;
    float features = 0.03f;
    float network = 6e-3f;
    float sky = 0.02f;
    float sky_smoothing = 1e-3f;  // see Sky::smooth; grows (skySmoothingFactor)
    float exposure = 5e-3f;
    float decay = 0.95f;     // of the voxels' second moments
    float epsilon = 1e-4f;   // on gradients summed over the batch
    float sparsity = 0.01f;  // see RmsPropRates: free space becomes empty although no view contradicts its fog ...
    float density_smoothing = 0.03f;  // ... surfaces are as smooth as the photographs let them be ...
    float feature_smoothing = 0.2f;   // ... and voxels that few rays met learn from their neighbours
};

/// What learns.
struct TrainState {
    VoxelField field;
    HugeArray<float> density_moment;  // [leaf][512]
    HugeArray<float> feature_moment;  // [leaf][512], one for all channels of a voxel
    Decoder decoder;
    Adam network;
    Exposures exposures;              // of the photographs; not part of the model
    Occupancy occupancy;
    std::vector<LeafMask> seen;       // [leaf] cells that held a kept sample since the last reset ...
    float min_seen = 0;               // ... of at least this weight
    Vec3f background = Vec3f::Ones();
    Sky sky;                          // learned in place of the background, unless empty
    Adam sky_optimizer;
    Behind behind = Behind::fixed;
    float distortion = kDistortion;
    float entropy = 0;
    float alpha = 0;
};

/// What a step saw; sums over its rays.
struct StepReport {
    double squared_error = 0;  // summed over rays and channels
    double distortion = 0;     // summed over rays
    double entropy = 0;        // of opacity, summed over rays
    double alpha_error = 0;    // squared, summed over rays
    double plain_opacity = 0;  // summed over rays whose pixels show just the plain background
    std::uint64_t rays = 0;
    TraceCounters trace;
    bool is_finite = true;
    // A ray whose colour or gradient was not finite; if only the network's sum was not, the batch's first.
    struct BadRay {
        int view = -1, x = 0, y = 0;
        float jitter = 0;
    } bad;

    void blame(const TrainingRay& ray) {
        is_finite = false;
        bad = {ray.view, ray.x, ray.y, ray.jitter};
    }
};

/// Runs steps; owns the working memory. Results do not depend on the number of threads.
class TrainStepper {
public:
    /// Draws a batch of rays and moves every parameter that they say something about. Nothing has moved if the
    /// report is not finite.
    StepReport step(TrainState& state, const RaySource& source, std::uint64_t step, int batch,
                    const StepRates& rates, const TraceOptions& trace);

    /// The two halves of a step. First the loss (squared_error + state.distortion * distortion + state.entropy * entropy +
    /// state.alpha * alpha_error + kPlainOpacity * plain_opacity) and its gradient; nothing moves ...
    StepReport differentiate(const TrainState& state, const RaySource& source, std::uint64_t step, int batch,
                             const TraceOptions& trace);
    /// ... which stands here: of the voxels, leaf by leaf as LeafScatter::run hands it out, once; of the network ...
    void voxelGradients(const TrainState& state, const LeafScatter::UseLeaf& use,
                        const LeafScatter::ExpectLeaf& expect = {});
    std::span<const float> networkGradient();
    /// ... of the sky, [height][width][3] as Sky::values; empty without one ...
    std::span<const float> skyGradient(const Sky& sky);
    /// ... and of the exposures, [view][Exposures::kValues].
    std::span<const double> exposureGradient(const Exposures& exposures);

private:
    static constexpr int kMaxTileRays = 256;
    struct Worker {
        RayTracer tracer{kMaxTileRays};
        Decoder::Workspace decoding;
        std::vector<TrainingRay> rays = std::vector<TrainingRay>(kMaxTileRays);
        std::vector<float> rgb = std::vector<float>(3 * kMaxTileRays);
        std::vector<float> dl_drgb = std::vector<float>(3 * kMaxTileRays);
        std::vector<float> dl_dtransmittance = std::vector<float>(kMaxTileRays);
    };
    /// What a ray that reaches the sky says about it.
    struct SkyRay {
        Sky::Sight sight;
        Vec3f dl_dcolor;
    };
    struct Tile {
        std::vector<float> dl_dnetwork;
        std::vector<SkyRay> sky_rays;
        StepReport report;
        std::vector<ExposedRay> exposed;  // empty unless exposures are learned
    };
    void runTile(const TrainState& state, const RaySource& source, std::uint64_t step, int first_ray, int n_rays,
                 const TraceScene& scene, const TraceOptions& trace, Tile& tile, TileGradients& gradients);

    PerThread<Worker> workers_;
    std::size_t n_tiles_ = 0;  // of the last batch
    std::vector<Tile> tiles_;
    std::vector<TileGradients> gradients_;
    std::vector<float> dl_dnetwork_, dl_dsky_, sky_scratch_;
    std::vector<double> dl_dexposures_;
    LeafScatter scatter_;
};

}  // namespace nerfvdb
