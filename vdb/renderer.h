// SPDX-License-Identifier: Apache-2.0
// Pictures of a model: march -> density -> composite -> features -> decode, by tiles of rays, in parallel.
#pragma once

#include "vdb/model.h"
#include "vdb/picture.h"

namespace nerfvdb {

struct RenderOptions {
    TraceOptions trace;
    float min_alpha = 0;      // cells whose densest corner stops less light than this over one voxel are skipped;
                              // 0: none, training has left only those that matter
    bool normals = false;     // also the picture of normals (costs a density gradient per kept sample)
    bool view_dependent = true;  // false: colours are the mean over all directions (Decoder::diffuse)
};

/// A model made ready to render: its occupied cells for a given threshold. Keeps a reference to the model.
/// Threads: render from one thread at a time; it uses all of them.
class Renderer {
public:
    Renderer(const Model& model, const RenderOptions& options);
    /// With occupied cells of the caller's choice instead of those above options.min_alpha.
    Renderer(const Model& model, const RenderOptions& options, Occupancy occupancy);
    RenderedImage render(const Camera& camera) const;

private:
    const Model& model_;
    RenderOptions options_;
    Occupancy occupancy_;
};

}  // namespace nerfvdb
