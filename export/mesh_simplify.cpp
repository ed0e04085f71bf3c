// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_simplify.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <string>

#include "core/error.h"
#include "export/mesh_repair.h"

namespace nerfvdb {
namespace {

constexpr int kTries = 6;       // of one halving; each leaves alone what spoilt the ones before
constexpr double kNear = 1.01;  // of the number wanted, else too much was left alone
constexpr double kFew = 1e-3;   // faults a vertex that are cut apart without much harm

/// Vertices whose triangles shall stay.
using Kept = std::vector<bool>;

/// The triangles after collapsing, those at kept vertices untouched.
std::vector<Triangle> collapse(const Mesh& mesh, const Kept& is_kept, std::size_t n_faces) {
    std::vector<Triangle> kept, rest;
    for (const Triangle& t : mesh.triangles)
        (is_kept[t[0]] || is_kept[t[1]] || is_kept[t[2]] ? kept : rest).push_back(t);
    if (rest.empty() || kept.size() >= n_faces) return mesh.triangles;
    static_assert(sizeof(Triangle) == 3 * sizeof(unsigned int) && sizeof(Vec3f) == 3 * sizeof(float));
    constexpr float kAnyError = 1;  // as large as the mesh: what is asked for is the number of faces
    std::vector<Triangle> collapsed(rest.size());
    const std::size_t n_corners = meshopt_simplify(
        collapsed[0].data(), rest[0].data(), 3 * rest.size(), mesh.positions[0].data(), mesh.positions.size(),
        sizeof(Vec3f), 3 * (n_faces - kept.size()), kAnyError, meshopt_SimplifyLockBorder, /*result_error=*/nullptr);
    collapsed.resize(n_corners / 3);
    collapsed.insert(collapsed.end(), kept.begin(), kept.end());
    return collapsed;
}

bool isNear(std::size_t n_faces, std::size_t wanted) {
    return static_cast<double>(n_faces) < kNear * static_cast<double>(wanted);
}

/// Collapses without tearing or joining; false, and no change, where that leaves too many triangles.
bool simplifyGently(Mesh& mesh, std::size_t n_faces) {
    Mesh simpler = mesh;
    Kept is_kept(mesh.positions.size(), false);
    std::size_t n_faults = 0;
    for (int i = 0; i < kTries; ++i) {
        simpler.triangles = collapse(mesh, is_kept, n_faces);
        if (!isNear(simpler.triangles.size(), n_faces)) return false;
        const std::vector<std::uint32_t> faults = nonManifoldVertices(simpler);
        for (const std::uint32_t vertex : faults) is_kept[vertex] = true;
        n_faults = faults.size();
        if (n_faults == 0) break;
    }
    if (static_cast<double>(n_faults) > kFew * static_cast<double>(n_faces)) return false;
    makeManifold(simpler);
    mesh = std::move(simpler);
    return true;
}

/// Collapses whatever has to, and cuts apart what touches itself. Cutting takes away triangles that came to lie on each
/// other, so the number is found by trying.
void simplifyRoughly(Mesh& mesh, std::size_t n_faces) {
    const Kept nothing(mesh.positions.size(), false);
    Mesh best;
    double aim = static_cast<double>(n_faces);
    for (int i = 0; i < kTries; ++i) {
        Mesh simpler = mesh;
        simpler.triangles = collapse(mesh, nothing, static_cast<std::size_t>(aim));
        makeManifold(simpler);
        const std::size_t found = simpler.triangles.size();
        if (found > best.triangles.size() && (isNear(found, n_faces) || best.triangles.empty()))
            best = std::move(simpler);
        if (isNear(found, n_faces) && isNear(n_faces, found)) break;
        aim *= std::min(2.0, static_cast<double>(n_faces) / static_cast<double>(std::max(found, kFewestFaces)));
    }
    if (!best.triangles.empty()) mesh = std::move(best);
}

}  // namespace

void simplifyMesh(Mesh& mesh, std::size_t n_faces) {
    if (n_faces < kFewestFaces)
        throw NumericError("mesh: simplify", std::to_string(n_faces) + " faces", "at least 4",
                           "no closed surface has fewer");
    checkTriangles(mesh);
    while (mesh.triangles.size() > n_faces) {
        const std::size_t half = std::max(n_faces, mesh.triangles.size() / 2);
        if (simplifyGently(mesh, half)) continue;
        simplifyRoughly(mesh, n_faces);
        break;
    }
}

}  // namespace nerfvdb
