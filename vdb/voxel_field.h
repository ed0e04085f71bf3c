// SPDX-License-Identifier: Apache-2.0
// A sparse field of learned values: density and a few feature channels per voxel, in leaf bricks beside the
// topology. One voxel size; nested levels are several fields.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>

#include "core/huge_array.h"
#include "core/types.h"
#include "vdb/topology.h"

namespace nerfvdb {

/// World units. OpenVDB refuses a transform whose voxel has a volume below 3e-15.
inline constexpr double kSmallestVoxel = 2e-5;

/// x_in_world = origin + voxel_size * x_in_index. Voxel values sit at integer index coordinates.
struct GridFrame {
    Vec3d origin = Vec3d::Zero();
    double voxel_size = 1.0;  // world units

    Vec3d worldFromIndex(const Vec3d& index) const { return origin + voxel_size * index; }
    Vec3d indexFromWorld(const Vec3d& world) const { return (world - origin) / voxel_size; }
};

inline constexpr float kMaxRaw = 15.0f;     // raw density is clamped here before exp
inline constexpr float kEmptyRaw = -20.0f;  // raw density of a voxel that holds nothing

/// Density activation: sigma = density_scale * exp(min(raw, kMaxRaw)), in 1 / world unit.
/// The clamp keeps its slope (d sigma / d raw = sigma everywhere), so that a clamped value can come back.
inline float sigmaFromRaw(float raw, double density_scale) {
    return static_cast<float>(density_scale * std::exp(std::min(raw, kMaxRaw)));
}

/// Values at voxel corners, trilinear between them (raw density is interpolated before its activation).
/// Voxels that are no corner of a cell that exists hold kEmptyRaw and zeros, and are never read.
class VoxelField {
public:
    VoxelField() = default;
    /// All densities kEmptyRaw, all features zero.
    VoxelField(Topology topology, const GridFrame& frame, int channels, double density_scale)
        : topology_(std::move(topology)), frame_(frame), channels_(channels), density_scale_(density_scale),
          density_(topology_.leafCount() * kLeafVoxels, kEmptyRaw),
          features_(topology_.leafCount() * kLeafVoxels * static_cast<std::size_t>(channels)) {}

    const Topology& topology() const { return topology_; }
    const GridFrame& frame() const { return frame_; }
    int channels() const { return channels_; }
    double densityScale() const { return density_scale_; }

    /// [leaf][512] raw density, before the activation.
    std::span<float> density() { return density_.span(); }
    std::span<const float> density() const { return density_.span(); }
    /// [leaf][512][channels]
    std::span<float> features() { return features_.span(); }
    std::span<const float> features() const { return features_.span(); }

    /// Box of all voxels in world units.
    Box worldBox() const {
        return {frame_.origin, frame_.worldFromIndex((topology_.dims() - Vec3i::Ones()).cast<double>())};
    }
    std::size_t bytes() const { return topology_.bytes() + density_.bytes() + features_.bytes(); }

private:
    Topology topology_;
    GridFrame frame_;
    int channels_ = 0;
    double density_scale_ = 1.0;
    HugeArray<float> density_;
    HugeArray<float> features_;
};

}  // namespace nerfvdb
