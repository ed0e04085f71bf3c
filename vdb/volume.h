// SPDX-License-Identifier: Apache-2.0
// A plain volume: density and colour at voxels, as every program that shows .vdb files takes them. Light is absorbed
// and emitted, nothing else:
//   sigma(x), c(x) trilinear between voxels, zero beyond;  C = sum_i w_i c_i + T_end background,  in linear RGB
// Source: Max 1995, "Optical models for direct volume rendering", absorption plus emission.
#pragma once

#include <span>

#include "core/huge_array.h"
#include "core/similarity.h"
#include "core/simd/kernels.h"
#include "vdb/occupancy.h"
#include "vdb/topology.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// Values in leaf bricks beside a topology whose cells are those that have an active voxel for a corner.
class Volume {
public:
    static constexpr int kChannels = 4;  // of a colour: linear red, green, blue, and a zero that aligns it

    Volume() = default;
    /// All zero. `active`: the voxels that hold something, by leaf, each leaf once, in any order, leaf coordinates as
    /// one likes (also negative): the frame says where voxel (0, 0, 0) of these coordinates lies.
    /// Throws DataError when the voxels lie so far apart that the tables of leaves would not fit (2^28 leaves), or
    /// fill more leaves than the kernels can number values of (2^22).
    Volume(std::span<const Topology::LeafCells> active, const GridFrame& frame);

    const Topology& topology() const { return topology_; }
    /// Of topology()'s own coordinates, which are not negative: other than those that were given.
    const GridFrame& frame() const { return frame_; }
    /// Add this to a voxel of topology() to get the coordinates that were given; multiples of 8.
    const Vec3i& firstVoxel() const { return first_voxel_; }
    /// The frame that was given: of those coordinates.
    GridFrame givenFrame() const {
        return {frame_.worldFromIndex(-first_voxel_.cast<double>()), frame_.voxel_size};
    }
    /// [leaf] voxels that were given.
    std::span<const LeafMask> active() const { return active_; }

    /// [leaf][512] extinction, 1 / world unit, not negative.
    std::span<float> sigma() { return sigma_.span(); }
    std::span<const float> sigma() const { return sigma_.span(); }
    /// [leaf][512][4] linear RGB.
    std::span<float> color() { return color_.span(); }
    std::span<const float> color() const { return color_.span(); }

    /// Where the grid lies in the world: turned and moved, nothing else (the scale is 1).
    const Similarity& worldFromGrid() const { return world_from_grid_; }
    /// Puts the volume elsewhere, turned and scaled. Light passes through it as before: sigma is divided by the scale.
    void place(const Similarity& new_from_world);

    /// The same volume on the active voxels that stand in `keep` [leaf]; elsewhere sigma is zero. Colours stay also
    /// on the voxels around, which interpolation reads.
    Volume restricted(std::span<const LeafMask> keep) const;

private:
    Topology topology_;
    GridFrame frame_;
    Vec3i first_voxel_ = Vec3i::Zero();
    Similarity world_from_grid_;
    std::vector<LeafMask> active_;
    HugeArray<float> sigma_;
    HugeArray<float> color_;
};

/// All cells of a volume, ready to be marched.
Occupancy allCells(const Volume& volume);

}  // namespace nerfvdb
