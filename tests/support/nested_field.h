// SPDX-License-Identifier: Apache-2.0
// Small fields in nested shells (vdb/shells.h), with values given by functions of the world.
#pragma once

#include <cmath>
#include <vector>

#include "tests/support/grid_field.h"
#include "vdb/adapt.h"
#include "vdb/voxel_field.h"

namespace nerfvdb::test {

/// Shells as training lays them: whole leaves between them.
inline Shells nestedShells(const Vec3i& extent, int count) { return {count, extent, (extent.x() + 31) / 16 * 16}; }

inline Vec3i nestedDims(const Shells& shells) {
    return {shells.count * shells.stride, (shells.extent.y() + 8) / 8 * 8, (shells.extent.z() + 8) / 8 * 8};
}

/// Cells [low, high) of a shell, local, that the next smaller one covers; none in shell 0.
inline bool isInHole(const Shells& shells, int shell, const Vec3i& local) {
    return shell > 0 && (local.array() * 4 >= shells.extent.array()).all() &&
           (local.array() * 4 < shells.extent.array() * 3).all();
}

/// Every cell that a shell owns and `keeps(shell, local cell)` says.
template <typename Keeps>
Topology nestedTopology(const Shells& shells, const Keeps& keeps) {
    const Vec3i dims = nestedDims(shells);
    return makeTopology(dims, Vec3i::Zero(), dims - Vec3i::Ones(), [&](const Vec3i& cell) {
        const int shell = shells.layerAt(cell.x());
        const Vec3i local = cell - Vec3i(shell * shells.stride, 0, 0);
        return (local.array() < shells.extent.array()).all() && !isInHole(shells, shell, local) && keeps(shell, local);
    });
}

inline Topology nestedTopology(const Shells& shells) {
    return nestedTopology(shells, [](int, const Vec3i&) { return true; });
}

/// A field without values, in a place that nothing is special about.
inline VoxelField nestedField(const Vec3i& extent, int count, int channels) {
    const Shells shells = nestedShells(extent, count);
    return {nestedTopology(shells), {Vec3d(-1.1, 0.7, 2.3), 0.05}, shells, channels, 10.0};
}

/// Calls visit(layer (the shell, where nothing is halved), place in the world, index) for every active voxel; index is its place in field.density().
template <typename Visit>
void forEachNested(const VoxelField& field, const Visit& visit) {
    forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t index) {
        const int layer = field.shells().layerAt(ijk.x());
        visit(layer, field.shells().frame(field.frame(), layer).worldFromIndex(ijk.cast<double>()), index);
    });
}

/// Sets ln(sigma / densityScale()) to a function of the world, the same in all shells; feature c to its slope along
/// axis c % 3.
template <typename LogSigma>
void setNested(VoxelField& field, const LogSigma& log_sigma) {
    forEachNested(field, [&](int layer, const Vec3d& world, std::size_t i) {
        field.density()[i] = static_cast<float>(log_sigma(world) + std::log(field.shells().layerScale(layer)));
        for (int c = 0; c < field.channels(); ++c)
            field.features()[i * static_cast<std::size_t>(field.channels()) + c] =
                static_cast<float>(std::sin(0.9 * world[c % 3] + c));
    });
}

/// The field with cells halved as often as [shell][x][y][z] says of each of `dims` regions a shell.
inline VoxelField halvedField(VoxelField field, const Vec3i& dims, const std::vector<std::uint8_t>& halvings) {
    for (int most = 1; most <= kMostHalvings; ++most) {
        Shells shells = field.shells();
        std::vector<std::uint8_t> so_far = halvings;
        for (std::uint8_t& n : so_far) n = std::min<std::uint8_t>(n, static_cast<std::uint8_t>(most));
        shells.regions = makeRegions(shells.count, dims, so_far);
        Topology topology = halveRegions(field.topology(), field.shells(), shells);
        field = halveField(std::move(field), std::move(topology), shells);
    }
    return field;
}

}  // namespace nerfvdb::test
