// SPDX-License-Identifier: Apache-2.0
// A field without bounds, out of bounded parts: an inner box, and hollow shells around it. Shell k has 2^k times the
// voxel size of shell 0 (which is the inner box), the same number of cells along each axis and the same centre, and
// leaves out what shell k - 1 covers. So the far is coarse, the extent grows with 2 to the power of the shells, the
// parts do not overlap, and all are in the world's own units: straight lines stay straight (no warped space as in
// Barron et al. 2022, "Mip-NeRF 360"; Neff et al.'s and instant-ngp's nested grids are the relatives).
//
// All shells share one topology: in index space they lie side by side along x, shell k from x = k * stride on, with
// at least one voxel of gap for upper corners. Whoever works on cells, leaves or values never notices; only who goes
// from the world to an index, or back, asks which shell.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/types.h"

namespace nerfvdb {

/// x_in_world = origin + voxel_size * x_in_index. Voxel values sit at integer index coordinates.
struct GridFrame {
    Vec3d origin = Vec3d::Zero();
    double voxel_size = 1.0;  // world units

    Vec3d worldFromIndex(const Vec3d& index) const { return origin + voxel_size * index; }
    Vec3d indexFromWorld(const Vec3d& world) const { return (world - origin) / voxel_size; }
};

inline constexpr int kMaxShells = 16;

/// How the shells of a field lie in its index space. With one shell the index space is the box itself.
struct Shells {
    int count = 1;
    Vec3i extent = Vec3i::Zero();  // cells of each shell along each axis; multiples of 4 if there is more than one shell
    int stride = 0;                // voxels from a shell to the next, along x; more than extent.x, and whole leaves

    int shellOf(int x) const { return count > 1 ? std::min(x / stride, count - 1) : 0; }
    /// Voxel size of a shell, in voxels of shell 0.
    static double scale(int shell) { return std::ldexp(1.0, shell); }
    /// Index-space corner of a shell's own box; the opposite one is `extent` further.
    Vec3d corner(int shell) const { return Vec3d(static_cast<double>(shell) * stride, 0, 0); }
    /// A point given in index coordinates of shell 0, in those of another.
    Vec3d fromInner(int shell, const Vec3d& inner) const {
        const Vec3d center = 0.5 * extent.cast<double>();
        return (inner - center) / scale(shell) + center + corner(shell);
    }
    /// World coordinates from index coordinates of a shell.
    GridFrame frame(const GridFrame& inner, int shell) const {
        const Vec3d center = 0.5 * extent.cast<double>();
        const double voxel_size = inner.voxel_size * scale(shell);
        return {inner.worldFromIndex(center) - voxel_size * (center + corner(shell)), voxel_size};
    }
    /// Whether they lie side by side in an index space of `dims` voxels, each with room for upper corners, in whole
    /// leaves of its own, and around whole cells of its own.
    bool fits(const Vec3i& dims) const {
        const bool are_whole = count == 1 || (stride % 8 == 0 && (extent.array() / 4 * 4 == extent.array()).all());
        return count >= 1 && count <= kMaxShells && are_whole && (extent.array() > 0).all() && extent.x() < stride &&
               extent.y() < dims.y() && extent.z() < dims.z() && stride <= dims.x() / count;
    }
    /// The same field at half the voxel size.
    Shells subdivided() const { return {count, extent * 2, stride * 2}; }
};

}  // namespace nerfvdb
