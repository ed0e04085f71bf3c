// SPDX-License-Identifier: Apache-2.0
// A triangle mesh with a normal and a colour per vertex, and the facts that tell whether it holds water.
// How a mesh comes to be is in marching_cubes.h; how it reaches a file, in mesh_io.h.
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace nerfvdb {

using Rgb8 = Eigen::Matrix<std::uint8_t, 3, 1>;
using Triangle = Eigen::Matrix<std::uint32_t, 3, 1>;  // vertex numbers, counter-clockwise seen from outside

/// Vertices are shared between triangles. `normals` and `colours` have one entry per vertex, or none at all.
struct Mesh {
    std::vector<Vec3f> positions;  // world units
    std::vector<Vec3f> normals;    // unit, pointing outside
    std::vector<Rgb8> colours;     // sRGB
    std::vector<Triangle> triangles;
};

/// Throws DataError when a triangle names a vertex that does not exist.
void checkTriangles(const Mesh& mesh);

/// An edge is *matched* when exactly two triangles share it and run along it in opposite directions.
struct MeshMeasures {
    std::size_t edges = 0;
    std::size_t open_edges = 0;        // one triangle only
    std::size_t bad_edges = 0;         // more than two triangles, or two in the same direction
    std::size_t degenerate_faces = 0;  // a vertex twice, or no area in double precision
    std::size_t pieces = 0;            // sets of triangles joined by vertices; unused vertices do not count
    std::int64_t euler = 0;            // used vertices - edges + faces; 2 for each closed piece without holes
    double area = 0;                   // world units squared
    double volume = 0;  // world units cubed; positive when the normals of a closed mesh point out

    bool closed() const { return open_edges == 0 && bad_edges == 0; }
};

/// Measures a mesh in time and memory linear in its size.
/// Throws as checkTriangles.
MeshMeasures measureMesh(const Mesh& mesh);

/// Number of the piece of each vertex: pieces are numbered by their lowest vertex, in rising order.
/// An unused vertex is a piece of its own. Throws as checkTriangles.
std::vector<std::uint32_t> piecesOfVertices(const Mesh& mesh);

}  // namespace nerfvdb
