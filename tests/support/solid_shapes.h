// SPDX-License-Identifier: Apache-2.0
// Closed meshes of known area and volume.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>

#include "export/mesh.h"

namespace nerfvdb::test {

inline void append(Mesh& mesh, const Mesh& other) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
    mesh.normals.insert(mesh.normals.end(), other.normals.begin(), other.normals.end());
    mesh.colours.insert(mesh.colours.end(), other.colours.begin(), other.colours.end());
    for (const Triangle& t : other.triangles) mesh.triangles.push_back(t + Triangle::Constant(first));
}

/// 20 * 4^levels triangles on a sphere, with its exact normals.
inline Mesh icosphere(int levels, float radius = 1, const Vec3f& centre = Vec3f::Zero()) {
    const float g = std::numbers::phi_v<float>;
    Mesh mesh;
    mesh.positions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                      {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    for (Vec3f& p : mesh.positions) p.normalize();
    mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
        const auto middle = [&](std::uint32_t a, std::uint32_t b) {
            const auto [entry, is_new] = middles.try_emplace(std::minmax({a, b}), mesh.positions.size());
            if (is_new) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]).normalized());
            return entry->second;
        };
        std::vector<Triangle> finer;
        for (const Triangle& t : mesh.triangles) {
            const std::uint32_t a = middle(t[0], t[1]), b = middle(t[1], t[2]), c = middle(t[2], t[0]);
            for (const Triangle& part :
                 {Triangle(t[0], a, c), Triangle(t[1], b, a), Triangle(t[2], c, b), Triangle(a, b, c)})
                finer.push_back(part);
        }
        mesh.triangles.swap(finer);
    }
    mesh.normals = mesh.positions;
    for (Vec3f& p : mesh.positions) p = radius * p + centre;
    return mesh;
}

/// A torus about z: n triangles along the ring by m about the tube, times two.
inline Mesh torus(std::uint32_t n, std::uint32_t m, float ring, float tube) {
    Mesh mesh;
    const float step_u = 2 * std::numbers::pi_v<float> / static_cast<float>(n);
    const float step_v = 2 * std::numbers::pi_v<float> / static_cast<float>(m);
    for (std::uint32_t i = 0; i < n; ++i)
        for (std::uint32_t j = 0; j < m; ++j) {
            const float u = step_u * static_cast<float>(i), v = step_v * static_cast<float>(j);
            const Vec3f out(std::cos(u), std::sin(u), 0);
            mesh.normals.push_back(std::cos(v) * out + std::sin(v) * Vec3f::UnitZ());
            mesh.positions.push_back(ring * out + tube * mesh.normals.back());
        }
    for (std::uint32_t i = 0; i < n; ++i)
        for (std::uint32_t j = 0; j < m; ++j) {
            const std::uint32_t k = (i + 1) % n, l = (j + 1) % m;
            mesh.triangles.push_back({i * m + j, k * m + j, k * m + l});
            mesh.triangles.push_back({i * m + j, k * m + l, i * m + l});
        }
    return mesh;
}

}  // namespace nerfvdb::test
