// SPDX-License-Identifier: Apache-2.0
// How the surface runs through one cube whose corners are inside or outside: a list of triangles for each of
// the 256 sign patterns and each answer to its ambiguous faces. The table is derived by code, not typed.
//
// Numbering: corner (x, y, z) of the cube is x * 4 + y * 2 + z. Edge axis * 4 + k runs along `axis` from its
// low corner; k counts the low corners of that axis in rising order. Face axis * 2 + side lies across `axis`.
//
// Sources: Lorensen and Cline 1987, "Marching cubes: a high resolution 3D surface construction algorithm";
// Nielson and Hamann 1991, "The asymptotic decider: resolving the ambiguity in marching cubes".
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace nerfvdb {

struct CubeEdge {
    int axis;     // 0, 1, 2: x, y, z
    int x, y, z;  // low corner
};

inline constexpr int kCubeEdges = 12;
inline constexpr int kCubeCentre = 12;  // corner of a triangle that is no edge: a vertex inside the cube
inline constexpr int kMostCubeTriangles = 12;

/// Triangles name edges of the cube (0..11), whose crossings they connect, or kCubeCentre, always last of
/// three. At most one loop of a cube needs a centre: the triangles that name it are the fan around that loop.
struct CubeTriangles {
    std::uint8_t count = 0;
    bool has_centre = false;
    std::array<std::array<std::uint8_t, 3>, kMostCubeTriangles> triangles{};
};

/// One pattern of corner signs (bit c of the pattern: corner c is inside).
struct CubePattern {
    std::uint16_t first_variant = 0;   // index in CubeTable::variants
    std::uint8_t ambiguous_faces = 0;  // bit f: on face f inside and outside corners alternate
};

struct CubeTable {
    std::array<CubeEdge, kCubeEdges> edges{};
    /// Corners of each face in cyclic order: 0 and 2, 1 and 3 are the diagonal pairs.
    std::array<std::array<std::uint8_t, 4>, 6> face_corners{};
    std::array<CubePattern, 256> patterns{};
    /// Variant of a pattern: bit i answers its i-th ambiguous face; set: the inside corners are joined there.
    std::vector<CubeTriangles> variants;
};

/// The table, made on first use. Threads: safe.
///
/// Each crossed edge of a cube is the end of one segment on either of its two faces, so the segments close to
/// loops. A loop is filled with triangles none of which has two corners on one face of the cube unless they are
/// joined by a segment there; where no such filling exists, with a fan around a centre. Therefore:
/// - both cubes at a face draw the same segments on it and no other edge, so that every edge of the mesh has
///   exactly two triangles, in opposite directions;
/// - no triangle lies in a face of a cube, so none is shared by two cubes and none is flat as long as the
///   crossings stay off the corners.
const CubeTable& cubeTable();

}  // namespace nerfvdb
