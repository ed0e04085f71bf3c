// SPDX-License-Identifier: Apache-2.0
// Mesh files: binary PLY and OBJ out, binary PLY in.
#pragma once

#include <filesystem>

#include "export/marching_cubes.h"
#include "export/mesh.h"

namespace nerfvdb {

/// Writes by extension, upper or lower case: .ply or .obj. Written to a temporary beside the target and
/// renamed.
///
/// .ply: binary little-endian; vertex: float x y z [nx ny nz], uchar [red green blue] (sRGB); face: list of
/// three
///       int32 vertex_indices behind a uchar count.
/// .obj: `v x y z [r g b]` (sRGB in [0, 1]), `vn` per vertex, `f a//a b//b c//c` counted from 1. Numbers are
/// the
///       shortest that read back as the same float.
/// Parts in brackets are there when the mesh has normals or colours.
/// Throws UsageError for another extension (see checkMeshPath), IoError when it cannot be written to the end (a
/// full disk), DataError when normals or colours do not match the vertices or a triangle names no vertex.
void writeMesh(const std::filesystem::path& path, const Mesh& mesh);

/// Extracts a surface right into a .ply: the file that writeMesh makes of extractSurface's mesh, but part by part, so
/// that the mesh never is in memory. Throws as streamSurface and writeMesh do, UsageError for another extension.
void streamPly(const std::filesystem::path& path, const Model& model, const MeshOptions& options, Report& report);

/// Throws the UsageError of writeMesh: call it before long work.
void checkMeshPath(const std::filesystem::path& path);

/// Reads a binary little-endian PLY of triangles, such as writeMesh makes; vertex properties that Mesh does not
/// know are skipped. Throws IoError, or DataError for another format, a truncated file, a face that is no
/// triangle.
Mesh readPly(const std::filesystem::path& path);

}  // namespace nerfvdb
