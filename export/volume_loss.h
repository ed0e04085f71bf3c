// SPDX-License-Identifier: Apache-2.0
// What a plain volume cannot say of the model that it came from, measured on pictures.
#pragma once

#include <span>

#include "core/report.h"
#include "vdb/model.h"
#include "vdb/volume.h"

namespace nerfvdb {

/// Means over the views, against the model's own pictures on its background.
struct VolumeLoss {
    int views = 0;
    double psnr = 0;           // of the volume's pictures, dB
    double psnr_diffuse = 0;   // of the model's own with the same colour from all sides: what view-dependence is worth
    double opacity_error = 0;  // mean of |opacity - the model's|
};

/// Renders at most 8 of the cameras, spread evenly, at most 400 pixels a side. The volume lies where the model does.
/// Throws UsageError without cameras, Interrupted.
VolumeLoss measureLoss(const Model& model, const Volume& volume, std::span<const Camera> cameras, Report& report);

}  // namespace nerfvdb
