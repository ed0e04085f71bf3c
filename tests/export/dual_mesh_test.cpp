// SPDX-License-Identifier: Apache-2.0
#include "export/dual_mesh.h"

#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

const Vec3d kCentre(15.3, 15.6, 15.9);
constexpr double kRadius = 11.2, kVoxel = 0.5;

/// A ball that is known of only near its surface when it is hollow.
Model ball(bool is_hollow = false) {
    Model model = modelOf(makeTopology(Vec3i::Constant(32), Vec3i::Zero(), Vec3i::Constant(31),
                                       [&](const Vec3i& c) {
                                           const double d = (c.cast<double>() - kCentre).norm() - kRadius;
                                           return d < 3 && (!is_hollow || d > -3);
                                       }),
                          {Vec3d(1, 2, 3), kVoxel});
    setDensity(model.field, [&](const Vec3i& p) {
        return static_cast<float>(2 * (kRadius - (p.cast<double>() - kCentre).norm()));
    });
    return model;
}

MeshOptions dual(double adaptivity = 0) {
    MeshOptions options = kPlain;
    options.method = SurfaceMethod::dual;
    options.adaptivity = adaptivity;
    return options;
}

}  // namespace

TEST_CASE("the second opinion agrees: a ball's place, volume, normals", "[export]") {
    const Model model = ball();
    const double volume = 4.0 / 3 * 3.14159265 * std::pow(kRadius * kVoxel, 3);
    std::size_t n_plain = 0;
    for (const double adaptivity : {0.0, 0.02}) {
        const Mesh mesh = extract(model, dual(adaptivity));
        INFO("adaptivity " << adaptivity);
        CHECK(complaint(mesh) == "");
        CHECK(measureMesh(mesh).euler == 2);
        CHECK(measureMesh(mesh).volume == Approx(volume).epsilon(0.03));
        for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
            const Vec3d from = model.field.frame().indexFromWorld(mesh.positions[v].cast<double>()) - kCentre;
            REQUIRE(from.norm() == Approx(kRadius).margin(0.2));
            REQUIRE(mesh.normals[v].cast<double>().dot(from.normalized()) > 0.97);
        }
        if (adaptivity == 0)
            n_plain = mesh.triangles.size();
        else
            CHECK(mesh.triangles.size() < n_plain * 0.9);
    }
    const std::size_t n_cubes = extract(model).triangles.size();
    CHECK(static_cast<double>(n_plain) == Approx(static_cast<double>(n_cubes)).epsilon(0.02));
}

TEST_CASE("the second opinion fills, keeps to bounds and resolutions, and does not depend on threads",
          "[export]") {
    const Model model = ball(true);
    CHECK(measureMesh(extract(model, dual())).pieces == 2);
    MeshOptions options = dual();
    options.fill_inside = true;
    CHECK(measureMesh(extract(model, options)).pieces == 1);
    options.bounds = Box{Vec3d(1, 2, 3), Vec3d(1, 2, 3) + kVoxel * Vec3d(15, 31, 31)};
    const Mesh half = extract(model, options);
    CHECK(measureMesh(half).closed());
    MeshOptions first_opinion = options;
    first_opinion.method = SurfaceMethod::marching_cubes;
    CHECK(measureMesh(half).volume == Approx(measureMesh(extract(model, first_opinion)).volume).epsilon(0.06));
    options.bounds.reset();
    options.resolution = 62;
    const Mesh fine = extract(model, options);
    CHECK(fine.triangles.size() > 3 * extract(model, dual()).triangles.size() / 2);
    const ThreadLimit limit(1);
    CHECK(sameBytes(fine, extract(model, options)));
    for (const double adaptivity : {-0.1, 1.1}) CHECK_THROWS_AS(extract(model, dual(adaptivity)), UsageError);
}
