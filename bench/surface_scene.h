// SPDX-License-Identifier: Apache-2.0
// Fields whose surfaces are known by formula and large: what extraction and export are measured on.
#pragma once

#include <string>
#include <vector>

#include "vdb/model.h"

namespace nerfvdb {

struct SurfaceScene {
    std::string name;
    Model model;  // density scale 1; without features unless asked for
};

/// Raw density at the surface of all scenes: sigma is 1 / world unit there, the voxel 1.
inline constexpr float kSceneIsoRaw = 0;

/// A shell three voxels thick around a ball with bumps, in a box of resolution^3 voxels: at 512 about 3 million
/// active voxels.
SurfaceScene bumpyShell(int resolution, int channels = 0);

/// The sheet of a gyroid of constant period, 1.2 voxels thick, in a ball: surface everywhere, and many thin
/// walls. At 512 some 4 % of the box's voxels are active. Source: Schoen 1970, "Infinite periodic minimal
/// surfaces without self-intersections"; the distance is that of its trigonometric approximation, to first
/// order.
SurfaceScene gyroidBall(int resolution, int channels = 0);

}  // namespace nerfvdb
