// SPDX-License-Identifier: Apache-2.0
// What no camera sees, made solid. Training knows of an opaque body only its skin: behind it lies what it began with, and
// the skin's inner face is a second surface, with holes through which fill_inside.h would take the body for hollow.
#pragma once

#include <cstddef>

#include "core/report.h"
#include "vdb/model.h"

namespace nerfvdb {

struct UnseenOptions {
    double rays = 16e6;           // about so many, spread evenly over all pixels of the cameras
    float least_light = 0.7f;     // a voxel is seen where so much of a ray's light comes as far as its cells
};

/// Raises the density of active voxels that no camera of the model sees, held-out ones aside, to at least twice `iso`
/// (1 / world unit), so that a surface at `iso` shows what cameras saw of it from outside, and nothing behind. Where a
/// camera sees through, as through haze, nothing changes; nor without cameras, nor for an iso that no voxel reaches: there is
/// no surface then, and there shall be none. Returns how many voxels were raised.
/// A voxel counts as seen if a cell around it is: cells that rays happen to miss hardly matter.
/// The same for any number of threads. Throws Interrupted.
/// Source: Kutulakos and Seitz 2000, "A theory of shape by space carving", with what light is left for the test of visibility.
std::size_t makeUnseenSolid(Model& model, double iso, Report& report, const UnseenOptions& options = {});

}  // namespace nerfvdb
