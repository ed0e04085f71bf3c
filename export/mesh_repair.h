// SPDX-License-Identifier: Apache-2.0
// Where a surface touches itself, as collapsing edges can leave it, and how to make a manifold of it again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "export/mesh.h"

namespace nerfvdb {

/// The vertices, rising, at which a mesh is no manifold: those of edges with more than two triangles or with two in the
/// same direction, those of two triangles that lie face to face, and those around which the triangles form several
/// rings. Open edges are no fault. Throws as checkTriangles.
std::vector<std::uint32_t> nonManifoldVertices(const Mesh& mesh);

struct RepairCounts {
    std::size_t dropped_faces = 0;   // degenerate, or lying on their opposites
    std::size_t added_vertices = 0;  // copies, where sheets touched; midpoints of doubled edges
    bool any() const { return dropped_faces + added_vertices > 0; }
};

/// Collapsing edges maps a closed surface to one in which every edge still has as many triangles in one direction as in
/// the other, though perhaps more than one pair. From such a mesh this makes a closed manifold of the same shape: every
/// edge has exactly two triangles, in opposite directions, and around every vertex they form one ring.
///
/// Triangles that name a vertex twice go, and pairs that lie on each other, face to face. The triangles of an edge are
/// paired about it so that solids which touch in the edge come apart. Vertices become one copy for each ring. An edge
/// that still has several pairs (a loop of two edges) gets a midpoint for each further pair. Sides that have no partner
/// stay open. New vertices take the normal and the colour of where they come from.
///
/// Cost: that of sorting the triangles. Throws as checkTriangles.
/// Source: after Guéziec, Taubin, Lazarus and Horn 2001, "Cutting and stitching: converting sets of polygons to
/// manifold surfaces"; the midpoints are ours.
RepairCounts makeManifold(Mesh& mesh);

}  // namespace nerfvdb
