// SPDX-License-Identifier: Apache-2.0
// The colour of a ray through a synthetic scene, by adaptive quadrature with a bound on its error.
#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "trainer/synthetic_scene.h"

namespace nerfvdb {

/// Light that arrives along a ray. Over a background b its colour is rgb + (1 - opacity) * b.
struct RayColour {
    Vec3d rgb = Vec3d::Zero();  // sRGB values, weighted by opacity (premultiplied)
    double opacity = 0;         // 1 - transmittance, in [0, 1]
};

struct ExactRayOptions {
    double tolerance = 5e-5;           // largest estimated error that one panel may add
    double panel_scale = 1.0;          // first panel length over the scene's featureLength
    double stop_transmittance = 1e-4;  // a ray ends when less light than this is left
};

/// C = integral of T sigma c dt, T = exp(-integral of sigma), over the scene's box from t = 0 on (Max 1995).
///
/// Adaptive Simpson: a panel is accepted when its transmittance from 3 and from 5 densities agree within the
/// tolerance and its colour is nearly straight, else halved. Optical depth inside a panel is the integral of
/// the parabola through its densities; the panel's weights are scaled to sum to -expm1(-tau), so that
/// sum(weights) + T == 1 to rounding.
/// Error: below 1e-3 in every channel (half an 8-bit level is 2e-3) for the scenes of synthetic_scene.h, which
/// is tested. Threads: safe.
RayColour exactRay(const SyntheticScene& scene, const Ray& ray, const ExactRayOptions& options = {});

/// Picture with straight alpha: 4 channels, rgb = colour / opacity in sRGB values, alpha = opacity; one ray
/// through each pixel's centre. Pixels whose alpha rounds to zero in 8 bits are black. Rows in parallel.
Image exactImage(const SyntheticScene& scene, const Camera& camera);

}  // namespace nerfvdb
