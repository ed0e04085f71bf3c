// SPDX-License-Identifier: Apache-2.0
// Models of given densities, their meshes, and what must hold for every mesh.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "export/marching_cubes.h"

namespace nerfvdb::test {

inline const MeshOptions kPlain{.iso = 1.0, .colours = false};  // with density_scale 1: raw iso 0

inline Mesh extract(const Model& model, const MeshOptions& options = kPlain) {
    Report silent;
    return extractSurface(model, options, silent);
}

inline Model modelOf(Topology topology, const GridFrame& frame = {}) {
    Model model;
    model.field = VoxelField(std::move(topology), frame, 0, 1.0);
    return model;
}

/// Around every vertex the triangles form one ring.
inline bool isVertexManifold(const Mesh& mesh) {
    struct Link {
        std::uint32_t vertex, from, to;
    };
    std::vector<Link> links;
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) links.push_back({t[k], t[(k + 1) % 3], t[(k + 2) % 3]});
    std::sort(links.begin(), links.end(), [](const Link& a, const Link& b) {
        return std::tie(a.vertex, a.from) < std::tie(b.vertex, b.from);
    });
    for (auto begin = links.begin(); begin != links.end();) {
        const auto end =
            std::find_if(begin, links.end(), [&](const Link& l) { return l.vertex != begin->vertex; });
        std::uint32_t at = begin->from;
        std::ptrdiff_t n = 0;
        do {
            const auto next = std::find_if(begin, end, [&](const Link& l) { return l.from == at; });
            if (next == end) return false;
            at = next->to;
        } while (++n <= end - begin && at != begin->from);
        if (n != end - begin) return false;
        begin = end;
    }
    return true;
}

inline bool hasDuplicateFaces(const Mesh& mesh) {
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const Triangle& t : mesh.triangles) {
        faces.push_back({t[0], t[1], t[2]});
        std::sort(faces.back().begin(), faces.back().end());
    }
    std::sort(faces.begin(), faces.end());
    return std::adjacent_find(faces.begin(), faces.end()) != faces.end();
}

inline bool sameBytes(const Mesh& a, const Mesh& b) {
    const auto same = [](const auto& u, const auto& v) {
        return u.size() == v.size() &&
               (u.empty() || std::memcmp(u.data(), v.data(), u.size() * sizeof(u[0])) == 0);
    };
    return same(a.positions, b.positions) && same(a.normals, b.normals) && same(a.colours, b.colours) &&
           same(a.triangles, b.triangles);
}

/// Everything that must hold for any surface; returns a complaint or nothing.
inline std::string complaint(const Mesh& mesh) {
    const MeshMeasures m = measureMesh(mesh);
    if (m.open_edges) return "open edges";
    if (m.bad_edges) return "edges without exactly two opposite triangles";
    if (m.degenerate_faces) return "degenerate faces";
    if (hasDuplicateFaces(mesh)) return "duplicate faces";
    if (!isVertexManifold(mesh)) return "a vertex with more than one ring";
    if (!(m.volume > 0)) return "volume not positive";
    for (const Vec3f& n : mesh.normals)
        if (!(std::abs(n.norm() - 1) < 1e-5f)) return "a normal that is not unit";  // float rounding
    return {};
}

}  // namespace nerfvdb::test
