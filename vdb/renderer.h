// SPDX-License-Identifier: Apache-2.0
// Pictures of a model: march -> density -> composite -> features -> decode, by tiles of rays, in parallel.
#pragma once

#include <cstdint>

#include "core/camera.h"
#include "core/image.h"
#include "core/report.h"
#include "vdb/model.h"

namespace nerfvdb {

struct RenderOptions {
    float step_voxels = 0.5f;           // distance between samples, in voxel edges
    float stop_transmittance = 1e-4f;   // a ray ends when less light than this is left; 1e-4: 1/40 of an 8-bit level
    float min_alpha = 0.01f;            // cells whose largest corner alpha over one voxel is below are skipped
    bool normals = false;               // also the picture of normals (costs a density gradient per sample)
};

/// What rendering cost; sums over all rays.
struct RenderCounters {
    std::uint64_t rays = 0;
    std::uint64_t rays_skipped = 0;       // met no occupied cell
    std::uint64_t samples_dense = 0;      // a dense march of the box at the same step, no early stop
    std::uint64_t samples_density = 0;    // density was read
    std::uint64_t samples_features = 0;   // features were read
    RenderCounters& operator+=(const RenderCounters& other);
};

struct RenderedImage {
    Image rgb;       // 3 channels, sRGB values over the model's background
    Image opacity;   // 1 channel, 1 - transmittance
    Image depth;     // 1 channel, mean distance along the ray weighted by contribution, world units; 0: nothing hit
    Image normal;    // 3 channels in [-1, 1], world axes, mean weighted by contribution; only with options.normals
    RenderCounters counters;
};

/// Ready to render: the occupied cells of a model, for a given threshold. Keeps a reference to the model.
class Renderer {
public:
    Renderer(const Model& model, const RenderOptions& options);
    ~Renderer();
    RenderedImage render(const Camera& camera) const;

private:
    struct Impl;
    Impl* impl_;
};

}  // namespace nerfvdb
