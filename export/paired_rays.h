// SPDX-License-Identifier: Apache-2.0
// The same rays through a model and through a plain volume: what the volume should show, and what it does show.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/report.h"
#include "vdb/leaf_scatter.h"
#include "vdb/model.h"
#include "vdb/volume.h"

namespace nerfvdb {

/// One thread's working memory for a tile of rays, and what became of them.
struct PairedTile {
    static constexpr int kMostRays = 256;
    std::vector<Ray> rays;
    RayTracer model{kMostRays}, volume{kMostRays};
    KeptSamples model_kept;
    Decoder::Workspace decoding;
    std::vector<float> rgb = std::vector<float>(3 * kMostRays);  // [ray][3] of the model, sRGB, nothing behind it
};

/// Borrows both.
class PairedRays {
public:
    PairedRays(const Model& model, const Volume& volume)
        : model_(model), occupied_(findOccupied(model.field, 0)), scene_(model.field, occupied_),
          cells_(allCells(volume)), volume_scene_(volume, cells_) {}

    /// Traces tile.rays through both; the volume's samples, at `jitter` (0..1) behind the first step, go to `kept`.
    void trace(float jitter, const TraceOptions& volume_options, PairedTile& tile, KeptSamples& kept) const {
        const TraceOptions model_options;
        tile.model.clear();
        tile.volume.clear();
        for (const Ray& ray : tile.rays) {
            tile.model.addRay(scene_, ray, model_options.step_voxels, 0.5f);
            tile.volume.addRay(volume_scene_, ray, volume_options.step_voxels, jitter);
        }
        tile.model.trace(scene_, model_options, tile.model_kept);
        const std::vector<std::int32_t>& lit = tile.model.litRays();
        std::fill(tile.rgb.begin(), tile.rgb.end(), 0.0f);
        model_.decoder.forward(static_cast<int>(lit.size()), tile.model.rayFeatures(), tile.model.directions(),
                               tile.model.transmittance(), tile.rgb.data(), tile.decoding, lit.data());
        tile.volume.trace(volume_scene_, volume_options, kept);
    }
    const TraceScene& volumeScene() const { return volume_scene_; }

private:
    const Model& model_;
    Occupancy occupied_;
    TraceScene scene_;
    Occupancy cells_;
    TraceScene volume_scene_;
};

inline void throwIfCancelled(const Report& report) {
    if (report.cancelled()) throw Interrupted("export: stopped on request; nothing was written");
}

}  // namespace nerfvdb
