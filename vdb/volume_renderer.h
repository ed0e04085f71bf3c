// SPDX-License-Identifier: Apache-2.0
// Pictures of a plain volume, as other programs make them: absorption and emission, blended in linear RGB.
#pragma once

#include "vdb/picture.h"
#include "vdb/volume.h"

namespace nerfvdb {

struct VolumeRenderOptions {
    float step_voxels = 0.5f;
    float stop_transmittance = 1e-4f;
    bool normals = false;
    Vec3f background = Vec3f::Ones();  // sRGB values
};

/// sRGB value of a linear one, clipped to [0, 1] as a PNG is.
float displayValue(float linear);

/// A volume made ready to render. Keeps a reference to it. Threads: as Renderer.
class VolumeRenderer {
public:
    VolumeRenderer(const Volume& volume, const VolumeRenderOptions& options);
    /// RenderedImage::rgb is encoded sRGB.
    RenderedImage render(const Camera& camera) const;

private:
    const Volume& volume_;
    VolumeRenderOptions options_;
    Occupancy occupancy_;
};

}  // namespace nerfvdb
