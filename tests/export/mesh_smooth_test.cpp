// SPDX-License-Identifier: Apache-2.0
#include "export/mesh_smooth.h"

#include <cstring>

#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/shell_model.h"
#include "tests/support/solid_shapes.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

/// A sphere whose vertices stand up to 2 % too high or too low.
Mesh roughSphere(int levels) {
    Mesh mesh = icosphere(levels);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) mesh.positions[v] *= 1 + 0.02f * signedNoise(1, v);
    return mesh;
}

/// Root mean square of the distance to the unit sphere.
double roughness(const Mesh& mesh) {
    double sum = 0;
    for (const Vec3f& p : mesh.positions) sum += std::pow(p.cast<double>().norm() - 1, 2);
    return std::sqrt(sum / static_cast<double>(mesh.positions.size()));
}

}  // namespace

TEST_CASE("smoothing takes noise off a sphere and leaves its volume and its triangles", "[export]") {
    Mesh mesh = roughSphere(5);
    const Mesh before = mesh;
    smoothMesh(mesh, 20);
    CHECK(roughness(mesh) < 0.3 * roughness(before));  // what is left are waves of ten edges and more
    CHECK(measureMesh(mesh).volume == Approx(measureMesh(before).volume).epsilon(2e-3));
    CHECK(mesh.triangles == before.triangles);
    double worst = 1;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        worst = std::min<double>(worst, mesh.normals[v].dot(mesh.positions[v].normalized()));
    CHECK(worst > 0.97);
}

TEST_CASE("the plain mean would shrink what the two steps keep", "[export]") {
    Mesh mesh = icosphere(3);
    const double before = measureMesh(mesh).volume;
    smoothMesh(mesh, 50);
    CHECK(measureMesh(mesh).volume == Approx(before).epsilon(0.01));  // half steps alone: less than 0.5 of it
}

TEST_CASE("smoothing is the same on any number of threads", "[export]") {
    Mesh one = roughSphere(5), many = one;
    {
        const ThreadLimit limit(1);
        smoothMesh(one, 3);
    }
    {
        const ThreadLimit limit(4);
        smoothMesh(many, 3);
    }
    CHECK(std::memcmp(one.positions.data(), many.positions.data(), one.positions.size() * sizeof(Vec3f)) == 0);
    CHECK(std::memcmp(one.normals.data(), many.normals.data(), one.normals.size() * sizeof(Vec3f)) == 0);
}

TEST_CASE("a mesh of nothing is smooth, and a lone vertex stays", "[export]") {
    Mesh mesh;
    smoothMesh(mesh, 3);
    mesh.positions.push_back(Vec3f(1, 2, 3));
    smoothMesh(mesh, 3);
    CHECK(mesh.positions[0] == Vec3f(1, 2, 3));
}
