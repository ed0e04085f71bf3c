// SPDX-License-Identifier: Apache-2.0
// Small fields in nested shells (vdb/shells.h), with values given by functions of the world.
#pragma once

#include <cmath>
#include <vector>

#include "tests/support/grid_field.h"
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
        const int shell = shells.shellOf(cell.x());
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

/// Calls visit(shell, place in the world, index) for every active voxel; index is its place in field.density().
template <typename Visit>
void forEachNested(const VoxelField& field, const Visit& visit) {
    forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t index) {
        const int shell = field.shells().shellOf(ijk.x());
        visit(shell, field.shells().frame(field.frame(), shell).worldFromIndex(ijk.cast<double>()), index);
    });
}

/// Sets ln(sigma / densityScale()) to a function of the world, the same in all shells; feature c to its slope along
/// axis c % 3.
template <typename LogSigma>
void setNested(VoxelField& field, const LogSigma& log_sigma) {
    forEachNested(field, [&](int shell, const Vec3d& world, std::size_t i) {
        field.density()[i] = static_cast<float>(log_sigma(world) + shell * std::log(2.0));
        for (int c = 0; c < field.channels(); ++c)
            field.features()[i * static_cast<std::size_t>(field.channels()) + c] =
                static_cast<float>(std::sin(0.9 * world[c % 3] + c));
    });
}

}  // namespace nerfvdb::test
