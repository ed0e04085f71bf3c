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

/// Cells of regions that `to` halves once more than `from` became eight, each in the layer where they now belong; the others
/// are as they were. `topology` is of `from`; the shells differ in nothing but their regions.
Topology halveRegions(const Topology& topology, const Shells& from, const Shells& to);

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

/// Values of a pool after halveRegions: of voxels that were there, the same; of new ones, what lay there before.
void halveValues(const Topology& from_topology, const Shells& from, const Topology& to_topology, int channels,
                 std::span<const float> in, std::span<float> out);

/// Both for a whole field.
VoxelField refineField(const VoxelField& field, Topology fine);
VoxelField copyField(const VoxelField& field, Topology to);

/// The same with less memory: old values go as soon as new ones stand in their place.
VoxelField refineField(VoxelField&& field, Topology fine);
/// `halved` is what halveRegions made of the field's topology and `shells`. Sigma stays what it was: raw density of what is
/// halved falls by ln 2, because half as much light is lost over half a voxel.
VoxelField halveField(VoxelField&& field, Topology halved, const Shells& shells);
/// `pruned` is what prune made of the field's topology. Values move within the field's own memory.
VoxelField pruneField(VoxelField&& field, Topology pruned);

}  // namespace nerfvdb
