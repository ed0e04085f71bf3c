// SPDX-License-Identifier: Apache-2.0
// A field without bounds, out of bounded parts: an inner box, and hollow shells around it. Shell k has 2^k times the
// voxel size of shell 0 (which is the inner box), the same number of cells along each axis and the same centre, and
// leaves out what shell k - 1 covers. So the far is coarse, the extent grows with 2 to the power of the shells, the
// parts do not overlap, and all are in the world's own units: straight lines stay straight (no warped space as in
// Barron et al. 2022, "Mip-NeRF 360"; Neff et al.'s and instant-ngp's nested grids are the relatives).
//
// Where photographs resolve more than a shell's voxels (near cameras that walk about), its cells are halved further: a shell
// is cut into regions of whole leaves, and a region's cells are halved not at all, once or twice (Regions). What all shells
// have halved so many times is called a layer: layer h * count + k is what shell k has halved h times. Regions do not
// overlap either, and each point belongs to one layer.
//
// All layers share one topology: in index space they lie side by side along x, shell k from x = k * stride on, then all
// shells again in twice the size for what is halved once, and so on, with at least one voxel of gap for upper corners. Whoever
// works on cells, leaves or values never notices; only who goes from the world to an index, or back, asks which layer.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

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
inline constexpr int kMostHalvings = 2;

/// How often cells are halved beyond a shell's own voxels, by region. Immutable.
struct Regions {
    /// `dims` regions of each shell along each axis; `halvings` [shell][x][y][z].
    Regions(const Vec3i& dims, std::vector<std::uint8_t> halvings);

    Vec3i dims;
    std::vector<std::uint8_t> halvings;
    int most = 0;                        // of the halvings
    struct Range {
        Vec3i first = Vec3i::Zero(), end = Vec3i::Zero();
    };
    std::vector<Range> halved;           // [shell] the smallest box of regions around those that are halved; empty: none

    std::size_t indexOf(int shell, const Vec3i& region) const {
        return ((static_cast<std::size_t>(shell) * dims.x() + region.x()) * dims.y() + region.y()) * dims.z() + region.z();
    }
    int at(int shell, const Vec3i& region) const { return halvings[indexOf(shell, region)]; }
};

/// Null if `halvings` are not as many as the regions of so many shells, or one is more than kMostHalvings.
std::shared_ptr<const Regions> makeRegions(int shells, const Vec3i& dims, std::vector<std::uint8_t> halvings);

/// How the shells of a field, and the layers of these, lie in its index space. With one shell (which has one layer) the
/// index space is the box itself.
struct Shells {
    int count = 1;
    Vec3i extent = Vec3i::Zero();  // cells of each shell along each axis; multiples of 4 if there is more than one shell
    int stride = 0;                // voxels from a shell to the next, along x; more than extent.x, and whole leaves
    std::shared_ptr<const Regions> regions = nullptr;  // null: nothing is halved

    int mostHalvings() const { return regions ? regions->most : 0; }
    int layerCount() const { return count * (mostHalvings() + 1); }
    int shellOf(int layer) const { return layer % count; }
    int halvingsOf(int layer) const { return layer / count; }
    int layerOf(int shell, int halvings) const { return halvings * count + shell; }
    /// By an index coordinate.
    int layerAt(int x) const {
        if (count == 1) return 0;
        int halvings = 0;
        while (halvings < kMostHalvings && x >= firstOf(halvings + 1)) ++halvings;
        return layerOf(std::min((x - firstOf(halvings)) / (stride << halvings), count - 1), halvings);
    }
    /// Voxel size of a shell, in voxels of shell 0 ...
    static double scale(int shell) { return std::ldexp(1.0, shell); }
    /// ... and of a layer.
    double layerScale(int layer) const { return std::ldexp(1.0, shellOf(layer) - halvingsOf(layer)); }
    /// Cells of a layer along each axis of its shell's box.
    Vec3i extentOf(int layer) const { return extent * (1 << halvingsOf(layer)); }
    /// Index-space corner of the box of a layer's shell; the opposite one is extentOf further.
    Vec3i corner(int layer) const {
        const int halvings = halvingsOf(layer);
        return {firstOf(halvings) + shellOf(layer) * (stride << halvings), 0, 0};
    }
    /// Of `dims` regions a shell, the one in which a layer's voxel lies.
    Vec3i regionOf(int layer, const Vec3i& voxel, const Vec3i& dims) const {
        return (voxel - corner(layer)).cwiseProduct(dims).cwiseQuotient(extentOf(layer));
    }
    /// A point given in index coordinates of shell 0, in those of a layer.
    Vec3d fromInner(int layer, const Vec3d& inner) const {
        const Vec3d center = 0.5 * extent.cast<double>(), center_here = 0.5 * extentOf(layer).cast<double>();
        return (inner - center) / layerScale(layer) + center_here + corner(layer).cast<double>();
    }
    /// World coordinates from index coordinates of a layer.
    GridFrame frame(const GridFrame& inner, int layer) const {
        const Vec3d center = 0.5 * extent.cast<double>(), center_here = 0.5 * extentOf(layer).cast<double>();
        const double voxel_size = inner.voxel_size * layerScale(layer);
        return {inner.worldFromIndex(center) - voxel_size * (center_here + corner(layer).cast<double>()), voxel_size};
    }
    /// Voxels along each axis of an index space that holds all layers, each in whole leaves.
    Vec3i dims() const {
        const int halvings = mostHalvings();
        Vec3i dims = (extent * (1 << halvings) + Vec3i::Constant(8)) / 8 * 8;
        dims.x() = firstOf(halvings + 1);
        return dims;
    }
    /// Whether they lie side by side in an index space of `dims` voxels, all of it along x, each with room for upper corners,
    /// in whole leaves of its own, around whole cells of its own, and in regions of whole leaves.
    bool fits(const Vec3i& dims) const {
        if (count < 1 || count > kMaxShells || (extent.array() <= 0).any() || (extent.array() >= dims.array()).any() ||
            extent.x() >= stride || stride > dims.x() / count)
            return false;  // before anything is multiplied
        if (count == 1) return !regions;
        const Vec3i last = extent * (1 << mostHalvings());
        return stride % 8 == 0 && (extent.array() / 4 * 4 == extent.array()).all() && regionsFit() && last.y() < dims.y() &&
               last.z() < dims.z() && firstOf(mostHalvings() + 1) == dims.x();
    }
    /// The same field at half the voxel size.
    Shells subdivided() const { return {count, extent * 2, stride * 2, regions}; }

private:
    /// Where the layers of so many halvings begin.
    int firstOf(int halvings) const { return count * stride * ((1 << halvings) - 1); }
    bool regionsFit() const {
        if (!regions) return true;
        const Vec3i& cut = regions->dims;
        return (cut.array() > 0).all() && (cut.array() <= extent.array() / 8).all() &&
               (extent.array() / cut.array() / 8 * 8 * cut.array() == extent.array()).all() &&
               regions->halved.size() == static_cast<std::size_t>(count);
    }
};

}  // namespace nerfvdb
