// SPDX-License-Identifier: Apache-2.0
// Other programs' ways to do what export/ does, on the same values, to be measured beside it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "vdb/voxel_field.h"

namespace nerfvdb {

struct PeerMesh {
    std::size_t triangles = 0;
    std::size_t bytes = 0;  // of points, normals and polygons, as the peer holds them
};

/// A peer with its input made ready, which is not measured: extract() is what is.
struct MeshPeer {
    std::string name;
    std::function<PeerMesh()> extract;
};

/// OpenVDB's volumeToMesh (dual contouring, Ju et al. 2002), adaptivity 0, without normals, which it does not
/// make; a quad counts as two triangles. Raw densities in a FloatGrid, kEmptyRaw outside.
MeshPeer volumeToMeshPeer(const VoxelField& field, float iso);

/// VTK's vtkFlyingEdges3D (Schroeder et al. 2015) with normals, on all values of the box made dense; it runs on
/// as many threads as VTK's build uses. Empty where VTK was not found when this program was built.
std::optional<MeshPeer> flyingEdgesPeer(const VoxelField& field, float iso);

/// The grids of a .vdb, read once; the function writes them to `to` as OpenVDB itself does (Blosc, active
/// mask).
std::function<void()> plainWriter(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace nerfvdb
