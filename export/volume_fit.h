// SPDX-License-Identifier: Apache-2.0
// Makes a plain volume look like the model that it came from. A model decodes a colour per ray, of the direction, too,
// blends it in sRGB and interpolates the logarithm of its density; a plain volume has one colour per voxel, blends
// light and interpolates sigma, which fattens every surface by up to a voxel. So density and colours are moved until
// pictures of the volume, made as other programs make them, agree with the model's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/huge_array.h"
#include "core/report.h"
#include "export/paired_rays.h"
#include "vdb/model.h"
#include "vdb/volume.h"

namespace nerfvdb {

struct FitOptions {
    int steps = 1000;
    int batch = 8192;           // rays a step
    std::uint64_t seed = 0;
    float density_rate = 0.2f;  // step of ln sigma, at first
    float color_rate = 0.01f;   // step of the root of linear colour, at first
    float last_rate = 0.1f;     // share of both rates that is left at the end
};

/// Least squares between the volume's pixels (sRGB values over random backgrounds) and the model's, by RMSprop on
/// ln sigma and on the root of linear colour, which is near to sRGB.
class VolumeFit {
public:
    /// Cameras are of the model's world, in which the volume must lie untouched. Borrows all but the options.
    /// A voxel begins with an optical depth of 4 at most, so that walls can move.
    VolumeFit(const Model& model, std::span<const Camera> cameras, const FitOptions& options, Volume& volume);

    /// Runs options.steps steps. The same for any number of threads. Throws Interrupted.
    void run(Report& report);

    /// The two halves of a step. First the loss of its batch, the mean over rays of squared differences summed over
    /// channels, and its gradient; nothing moves ...
    double differentiate(int step);
    /// ... which stands here, times the number of rays: of sigma and linear colour, leaf by leaf as LeafScatter::run
    /// hands it out, once.
    void gradients(const LeafScatter::UseLeaf& use, const LeafScatter::ExpectLeaf& expect = {});

private:
    void drawRays(int step, std::size_t tile, std::vector<Ray>& rays) const;
    double differentiateTile(int step, std::size_t tile);
    void move(int step);

    const Model& model_;
    std::span<const Camera> cameras_;
    FitOptions options_;
    Volume& volume_;
    PairedRays rays_;
    HugeArray<float> log_sigma_, root_color_, density_moment_, color_moment_;
    PerThread<PairedTile> paired_;
    std::vector<TileGradients> tiles_;
    LeafScatter scatter_;
};

}  // namespace nerfvdb
