// SPDX-License-Identifier: Apache-2.0
// The point of a mesh that is nearest to another point: a tree of boxes over the triangles.
#pragma once

#include <cstdint>
#include <vector>

#include "export/mesh.h"

namespace nerfvdb {

/// The point of a triangle nearest to `p`, exactly: inside, on an edge or at a corner; any triangle, even without area.
/// Source: Ericson 2005, "Real-time collision detection", 5.1.5.
Vec3d nearestOnTriangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c);

struct NearestPoint {
    double squared_distance = 0;  // world units squared
    std::uint32_t triangle = 0;
};

/// Halves the triangles by the median of their centres, along the longest side of the centres' box, down to leaves of
/// a few triangles. The halves are as large as can be, so that ranges follow from a node's number alone.
/// Time to build: n log n, parallel. 24 bytes a node and 4 a triangle beside the mesh, which must stay.
class TriangleTree {
public:
    /// Needs at least one triangle. Throws as checkTriangles.
    explicit TriangleTree(const Mesh& mesh);

    /// The distance is exact, up to rounding in double precision. Of several nearest triangles (at an edge) it names
    /// always the same. Threads: safe.
    NearestPoint nearest(const Vec3d& point) const;

private:
    struct Bounds {
        Vec3f low, high;
    };
    struct Range {
        std::size_t begin, end;
    };

    Range rangeOf(int depth, std::size_t index) const;
    void sortNode(int depth, std::size_t index, const std::vector<Vec3f>& centres);
    Bounds boundsOfLeaf(Range range) const;

    const Mesh& mesh_;
    int depth_ = 0;                     // of the leaves; the root has 0
    std::vector<std::uint32_t> order_;  // triangles, those of a node in a row
    std::vector<Bounds> bounds_;        // children of node i are 2 i + 1 and 2 i + 2
};

}  // namespace nerfvdb
