// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_smooth.h"

#include "core/parallel.h"
#include "export/mesh_normals.h"
#include "export/vertex_faces.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kVerticesPerTask = 4096;

// 1 / lambda + 1 / mu is Taubin's pass band: waves below it grow a little in each round. At his 0.1 a sphere gains 4 %
// of volume in 50 rounds, at 0.03 less than 1 %. lambda = 0.5 stops the shortest waves in one step.
constexpr double kPassBand = 0.03;
constexpr double kTowards = 0.5, kAway = -1 / (1 / kTowards - kPassBand);

/// Moves every vertex by `share` of its way to the mean of its neighbours.
void moveTowardsNeighbours(Mesh& mesh, const VertexFaces& faces, double share, std::vector<Vec3f>& moved) {
    parallelRanges(mesh.positions.size(), kVerticesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            const std::span<const std::uint32_t> ring = faces.of(v);
            const Vec3d at = mesh.positions[v].cast<double>();
            // Inside a surface each neighbour belongs to two triangles of the ring, on a border to one.
            Vec3d sum = Vec3d::Zero();
            for (const std::uint32_t face : ring)
                for (int k = 0; k < 3; ++k) sum += mesh.positions[mesh.triangles[face][k]].cast<double>() - at;
            moved[v] = (at + (ring.empty() ? 0 : share / (2.0 * ring.size())) * sum).cast<float>();
        }
    });
    mesh.positions.swap(moved);
}

}  // namespace

void smoothMesh(Mesh& mesh, int rounds) {
    const VertexFaces faces(mesh);
    std::vector<Vec3f> moved(mesh.positions.size());
    for (int i = 0; i < rounds; ++i) {
        moveTowardsNeighbours(mesh, faces, kTowards, moved);
        moveTowardsNeighbours(mesh, faces, kAway, moved);
    }
    computeNormals(mesh, faces);
}

}  // namespace nerfvdb
