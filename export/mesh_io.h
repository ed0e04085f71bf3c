// SPDX-License-Identifier: Apache-2.0
// Mesh files: binary PLY, OBJ, binary STL and glTF out, binary PLY in.
#pragma once

#include <filesystem>

#include "core/similarity.h"
#include "export/marching_cubes.h"
#include "export/mesh.h"

namespace nerfvdb {

enum class MeshFormat { ply, obj, stl, glb };

/// The format that a file name's extension chooses, upper or lower case. Throws UsageError for another extension: ask
/// before long work.
MeshFormat meshFormat(const std::filesystem::path& path);

/// Writes in the format of meshFormat(path), to a temporary beside the target that is then renamed.
///
/// .ply: binary little-endian; vertex: float x y z [nx ny nz], uchar [red green blue] (sRGB); face: list of
///       three int32 vertex_indices behind a uchar count.
/// .obj: `v x y z [r g b]` (sRGB in [0, 1]), `vn` per vertex, `f a//a b//b c//c` counted from 1. Numbers are
///       the shortest that read back as the same float.
/// .stl: binary; three corners and the normal of each triangle. Neither colours nor shared vertices: STL has none.
/// .glb: see gltf_file.h. `up` is the axis that points up in the mesh's world; the other formats do not say.
/// Parts in brackets are there when the mesh has normals or colours.
/// Throws UsageError as meshFormat, IoError when it cannot be written to the end (a full disk), DataError when normals
/// or colours do not match the vertices or a triangle names no vertex, and what writeGlb throws.
void writeMesh(const std::filesystem::path& path, const Mesh& mesh, UpAxis up = UpAxis::z);

/// Extracts a surface right into a .ply: the file that writeMesh makes of extractSurface's mesh, but part by part, so
/// that the mesh never is in memory. Throws as streamSurface and writeMesh do, UsageError for another extension.
void streamPly(const std::filesystem::path& path, const Model& model, const MeshOptions& options, Report& report);

/// Reads a binary little-endian PLY of triangles, such as writeMesh makes; vertex properties that Mesh does not
/// know are skipped. Throws IoError, or DataError for another format, a truncated file, a face that is no
/// triangle.
Mesh readPly(const std::filesystem::path& path);

}  // namespace nerfvdb
