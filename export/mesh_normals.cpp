// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_normals.h"

#include <Eigen/Geometry>
#include <cmath>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr std::size_t kVerticesPerTask = 4096;

/// Normal of a triangle times its angle at a vertex, which must be one of its corners.
Vec3d weightedNormal(const Mesh& mesh, const Triangle& t, std::uint32_t vertex) {
    const int k = t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2;
    const Vec3d at = mesh.positions[vertex].cast<double>();
    const Vec3d to_next = mesh.positions[t[(k + 1) % 3]].cast<double>() - at;
    const Vec3d to_last = mesh.positions[t[(k + 2) % 3]].cast<double>() - at;
    const Vec3d normal = to_next.cross(to_last);
    const double length = normal.norm();
    if (length == 0) return Vec3d::Zero();
    return normal * (std::atan2(length, to_next.dot(to_last)) / length);
}

}  // namespace

void computeNormals(Mesh& mesh, const VertexFaces& faces) {
    mesh.normals.resize(mesh.positions.size());
    parallelRanges(mesh.positions.size(), kVerticesPerTask, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
            Vec3d sum = Vec3d::Zero();
            for (const std::uint32_t face : faces.of(v))
                sum += weightedNormal(mesh, mesh.triangles[face], static_cast<std::uint32_t>(v));
            const double length = sum.norm();
            mesh.normals[v] = length > 0 ? Vec3f((sum / length).cast<float>()) : Vec3f::UnitZ();
        }
    });
}

}  // namespace nerfvdb
