// SPDX-License-Identifier: Apache-2.0
// A picture of where photographs were taken: cameras from above and from the side, with the scene's box.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "trainer/capture_report.h"

namespace nerfvdb {

struct CapturePlot {
    std::string title;
    std::optional<Box> scene_box;
    Vec3d middle = Vec3d::Zero();  // marked by a cross
};

/// The direction that cameras have above them: the world axis next to the mean of their upward directions, or that
/// mean where no axis is within 30 degrees of it; z where the cameras agree on nothing.
Vec3d upOfCameras(std::span<const CaptureView> views);

/// One SVG document with two views to one scale, parallel projections along the up direction and across it. A camera
/// is a small pyramid, its tip where the lens is; held-out ones have another colour. The cameras fill the picture: of
/// a box that is much larger only what fits is drawn. Unusable cameras are left out. Equal input gives equal bytes.
std::string svgText(const CapturePlot& plot, std::span<const CaptureView> views);

}  // namespace nerfvdb
