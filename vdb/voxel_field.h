// SPDX-License-Identifier: Apache-2.0
// A sparse field of learned values: density and a few feature channels per voxel, in leaf bricks beside the
// topology. A box of one voxel size, or nested shells of growing ones (shells.h).
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "core/huge_array.h"
#include "core/types.h"
#include "vdb/shells.h"
#include "vdb/topology.h"

namespace nerfvdb {

/// World units. OpenVDB refuses a transform whose voxel has a volume below 3e-15.
inline constexpr double kSmallestVoxel = 2e-5;

inline constexpr float kMaxRaw = 15.0f;     // raw density is clamped here before exp
inline constexpr float kEmptyRaw = -20.0f;  // raw density of a voxel that holds nothing

/// Density activation: sigma = density_scale * exp(min(raw, kMaxRaw)), in 1 / world unit.
/// The clamp keeps its slope (d sigma / d raw = sigma everywhere), so that a clamped value can come back.
inline float sigmaFromRaw(float raw, double density_scale) {
    return static_cast<float>(density_scale * std::exp(std::min(raw, kMaxRaw)));
}

/// Values at voxel corners, trilinear between them (raw density is interpolated before its activation).
/// Raw density means the same light lost over a voxel in every layer: one whose voxels are n times those of shell 0 has
/// density_scale / n.
/// Voxels that are no corner of a cell that exists hold kEmptyRaw and zeros, and are never read.
class VoxelField {
public:
    VoxelField() = default;
    /// All densities kEmptyRaw, all features zero. One box.
    VoxelField(Topology topology, const GridFrame& frame, int channels, double density_scale)
        : VoxelField(std::move(topology), frame, {}, channels, density_scale) {
        shells_.extent = topology_.dims() - Vec3i::Ones();
    }
    /// The same in shells.
    VoxelField(Topology topology, const GridFrame& frame, const Shells& shells, int channels, double density_scale)
        : VoxelField(std::move(topology), frame, shells, channels, density_scale, {}, {}) {
        density_ = HugeArray<float>(topology_.leafCount() * kLeafVoxels, kEmptyRaw);
        features_ = HugeArray<float>(topology_.leafCount() * kLeafVoxels * static_cast<std::size_t>(channels));
    }
    /// With these values, as density() and features() have them.
    VoxelField(Topology topology, const GridFrame& frame, const Shells& shells, int channels, double density_scale,
               HugeArray<float> density, HugeArray<float> features)
        : topology_(std::move(topology)), frame_(frame), shells_(shells), channels_(channels),
          density_scale_(density_scale), density_(std::move(density)), features_(std::move(features)) {}

    const Topology& topology() const { return topology_; }
    /// Of shell 0: the inner box.
    const GridFrame& frame() const { return frame_; }
    const Shells& shells() const { return shells_; }
    int channels() const { return channels_; }
    /// Of shell 0.
    double densityScale() const { return density_scale_; }

    /// [leaf][512] raw density, before the activation.
    std::span<float> density() { return density_.span(); }
    std::span<const float> density() const { return density_.span(); }
    /// [leaf][512][channels]
    std::span<float> features() { return features_.span(); }
    std::span<const float> features() const { return features_.span(); }

    /// The values themselves; the field has none afterwards.
    HugeArray<float> takeDensity() { return std::move(density_); }
    HugeArray<float> takeFeatures() { return std::move(features_); }

    /// Box of one shell (with what it leaves out) in world units.
    Box shellBox(int shell) const {
        const GridFrame frame = shells_.frame(frame_, shell);
        const Vec3d corner = shells_.corner(shell).cast<double>();
        return {frame.worldFromIndex(corner), frame.worldFromIndex(corner + shells_.extent.cast<double>())};
    }
    /// Box of all voxels in world units.
    Box worldBox() const { return shellBox(shells_.count - 1); }
    std::size_t bytes() const { return topology_.bytes() + density_.bytes() + features_.bytes(); }

private:
    Topology topology_;
    GridFrame frame_;
    Shells shells_;
    int channels_ = 0;
    double density_scale_ = 1.0;
    HugeArray<float> density_;
    HugeArray<float> features_;
};

}  // namespace nerfvdb
