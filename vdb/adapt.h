// SPDX-License-Identifier: Apache-2.0
// How a field follows the scene: cells are dropped where nothing is, and split in eight where more is to be seen.
// Values are carried over exactly: halving the voxel size changes nothing that a ray reads.
#pragma once

#include <span>
#include <vector>

#include "vdb/topology.h"
#include "vdb/voxel_field.h"

namespace nerfvdb {

/// The topology of half the voxel size in which every cell of `cells` (a subset per leaf) became eight.
Topology subdivide(const Topology& coarse, std::span<const LeafMask> cells);

/// The topology that keeps `cells` (a subset per leaf) and nothing else.
Topology prune(const Topology& topology, std::span<const LeafMask> cells);

/// `cells` (a subset per leaf) and their neighbours across faces, edges and corners, as far as they exist.
std::vector<LeafMask> dilateCells(const Topology& topology, std::span<const LeafMask> cells);

/// Values of a pool of bricks ([leaf][512][channels]) at half the voxel size: fine voxels lie on coarse ones or
/// half-way between, so trilinear interpolation is a mean of 1, 2, 4 or 8. Voxels of `fine` only; others untouched.
void refineValues(const Topology& coarse, const Topology& fine, int channels, std::span<const float> in,
                  std::span<float> out);

/// Copies the values of voxels that both topologies have; same voxel size.
void copyValues(const Topology& from, const Topology& to, int channels, std::span<const float> in,
                std::span<float> out);

/// Both for a whole field.
VoxelField refineField(const VoxelField& field, Topology fine);
VoxelField copyField(const VoxelField& field, Topology to);

/// The same with less memory: old values go as soon as new ones stand in their place.
VoxelField refineField(VoxelField&& field, Topology fine);
/// `pruned` is what prune made of the field's topology. Values move within the field's own memory.
VoxelField pruneField(VoxelField&& field, Topology pruned);

}  // namespace nerfvdb
