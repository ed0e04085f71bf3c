// SPDX-License-Identifier: Apache-2.0
#include "export/block_mesh.h"

#include <algorithm>

#include "export/surface_crossing.h"

namespace nerfvdb {
namespace {

/// Numbers of the vertices on the edges of a block's cells.
class EdgeNumbers {
public:
    EdgeNumbers(const BlockList& blocks, const Block& block) {
        for (int edge = 0; edge < kCubeEdges; ++edge) {
            const CubeEdge& e = cubeTable().edges[edge];
            places_[edge] = e.axis * 729 + e.x * 81 + e.y * 9 + e.z;
        }
        std::uint32_t number = block.first_vertex;
        for (int x = 0; x < kLeafDim; ++x)
            for (int axis = 0; axis < 3; ++axis)
                forEachBit(block.crossed[axis][x], [&](int bit) {
                    numbers_[axis * 729 + x * 81 + (bit >> 3) * 9 + (bit & 7)] = number++;
                });
        numberNeighbours(blocks, block);
    }

    /// Numbers by place(edge) of the cell (x, y, z).
    const std::uint32_t* ofCell(int x, int y, int z) const { return &numbers_[x * 81 + y * 9 + z]; }
    int place(int edge) const { return places_[edge]; }

private:
    /// The upper edges of the block's cells belong to its neighbours, and so do the vertices there.
    void numberNeighbours(const BlockList& blocks, const Block& block) {
        for (int corner = 1; corner < 8; ++corner) {
            const Vec3i step = cornerStep(corner);
            const Block* owner = blocks.find(block.leaf + step);
            if (!owner) continue;
            const std::uint64_t border =
                (step.y() ? 0xffull : ~0ull) & (step.z() ? 0x0101010101010101ull : ~0ull);
            for (int axis = 0; axis < 3; ++axis) {
                if (step[axis]) continue;  // starts at the far side and leads away
                std::uint32_t* place = &numbers_[axis * 729 + 8 * (step.x() * 81 + step.y() * 9 + step.z())];
                for (int x = 0; x < (step.x() ? 1 : kLeafDim); ++x) {
                    const std::uint64_t word = owner->crossed[axis][x];
                    forEachBit(word & border, [&](int bit) {
                        const int before = std::popcount(word & ((std::uint64_t{1} << bit) - 1));
                        place[x * 81 + (bit >> 3) * 9 + (bit & 7)] =
                            owner->first_vertex + owner->rank[x][axis] + before;
                    });
                }
            }
        }
    }

    std::array<int, kCubeEdges> places_;          // in numbers_, from those of a cell's first corner
    std::array<std::uint32_t, 3 * 729> numbers_;  // [axis][x][y][z], 9 a side; only crossed edges are filled
};

/// The vertex inside of a cell is the mean of the loop around it: inside, because no face holds the whole loop.
SurfacePoint centreOf(const BlockCrossings& crossings, int x, int y, int z, const CubeTriangles& cube) {
    SurfacePoint mean{Vec3f::Zero(), Vec3f::Zero()};
    int n = 0;
    for (int i = 0; i < cube.count; ++i) {
        if (cube.triangles[i][2] != kCubeCentre) continue;
        const CubeEdge& e = cubeTable().edges[cube.triangles[i][0]];
        const SurfacePoint point = crossings.at(x + e.x, y + e.y, z + e.z, e.axis);
        mean.position += point.position;
        mean.normal += point.normal;
        ++n;
    }
    mean.position /= static_cast<float>(n);
    const float length = mean.normal.norm();
    mean.normal = length > 1e-3f ? Vec3f(mean.normal / length) : Vec3f::UnitZ();  // a saddle may have no side
    return mean;
}

}  // namespace

void writeBlockVertices(const Surface& surface, const Block& block, Vec3f* positions, Vec3f* normals) {
    const BlockCrossings crossings(surface, block.leaf);
    const Vec3d first = (block.leaf * kLeafDim).cast<double>();
    const auto write = [&](const SurfacePoint& point) {
        *positions++ =
            surface.field.frame().worldFromIndex(first + point.position.cast<double>()).cast<float>();
        *normals++ = point.normal;
    };
    for (int x = 0; x < kLeafDim; ++x)
        for (int axis = 0; axis < 3; ++axis)
            forEachBit(block.crossed[axis][x],
                       [&](int bit) { write(crossings.at(x, bit >> 3, bit & 7, axis)); });
    if (block.n_centres == 0) return;
    forEachCrossedCell(BlockCorners(surface, block.leaf), surface.iso,
                       [&](int x, int y, int z, const CubeTriangles& cube) {
                           if (cube.has_centre) write(centreOf(crossings, x, y, z, cube));
                       });
}

void writeBlockTriangles(const Surface& surface, const BlockList& blocks, const Block& block,
                         Triangle* triangles) {
    const EdgeNumbers numbers(blocks, block);
    std::uint32_t centre = block.first_vertex + block.n_edges;
    forEachCrossedCell(BlockCorners(surface, block.leaf), surface.iso,
                       [&](int x, int y, int z, const CubeTriangles& cube) {
                           const std::uint32_t* const cell = numbers.ofCell(x, y, z);
                           const auto number = [&](int edge) {
                               return edge == kCubeCentre ? centre : cell[numbers.place(edge)];
                           };
                           for (int i = 0; i < cube.count; ++i) {
                               const auto& [a, b, c] = cube.triangles[i];
                               *triangles++ = Triangle(number(a), number(b), number(c));
                           }
                           centre += cube.has_centre;
                       });
}

void markClosingTriangles(const Surface& surface, const Block& block, std::uint8_t* is_closing) {
    const Topology& topology = surface.field.topology();
    const std::int32_t leaf = topology.findLeaf(block.leaf);
    const LeafMask cells = leaf >= 0 ? topology.cells()[static_cast<std::size_t>(leaf)] : LeafMask{};
    forEachCrossedCell(BlockCorners(surface, block.leaf), surface.iso,
                       [&](int x, int y, int z, const CubeTriangles& cube) {
                           const Vec3i cell = block.leaf * kLeafDim + Vec3i(x, y, z);
                           const bool is_known = testBit(cells, brickOffset(x, y, z)) && surface.bounds.contains(cell) &&
                                                 surface.bounds.contains(cell + Vec3i::Ones());
                           is_closing = std::fill_n(is_closing, cube.count, static_cast<std::uint8_t>(!is_known));
                       });
}

}  // namespace nerfvdb
