// SPDX-License-Identifier: Apache-2.0
#include "export/unseen_solid.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "export/marching_cubes.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

namespace {

constexpr int kVoxels = 48;
constexpr double kRadius = 14;  // of a ball in the middle, voxels
constexpr double kIso = 0.7;    // as the density scale is 1, raw density ln 0.7

Report silent;

/// A ball as training leaves it: a skin of three voxels, behind it and before it fog; a voxel is a world unit.
Model skinModel(float skin_raw, bool has_cameras = true) {
    std::vector<Topology::LeafCells> cells;
    for (int i = 0; i < kVoxels * kVoxels * kVoxels / kLeafVoxels; ++i) {
        constexpr int n = kVoxels / kLeafDim;
        Topology::LeafCells entry{{i / (n * n), i / n % n, i % n}, {}};
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i ijk = entry.leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            if (ijk.maxCoeff() < kVoxels - 1) setBit(entry.cells, offset);
        }
        cells.push_back(entry);
    }
    Model model;
    model.field = VoxelField(Topology(Vec3i::Constant(kVoxels), cells), {Vec3d::Zero(), 1.0}, 4, 1.0);
    const Topology& topology = model.field.topology();
    const Vec3d centre = Vec3d::Constant(kVoxels / 2);
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const Vec3i ijk = topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const double depth = kRadius - (ijk.cast<double>() - centre).norm();
            model.field.density()[leaf * kLeafVoxels + static_cast<std::size_t>(offset)] =
                depth >= 0 && depth < 3 ? skin_raw : -9.0f;
        });
    model.decoder = Decoder(4, 1);
    if (!has_cameras) return model;
    for (int i = 0; i < 14; ++i) {  // from all sides: on a Fibonacci lattice
        const double z = 1 - (2 * i + 1) / 14.0, angle = i * (3 - std::sqrt(5.0)) * std::numbers::pi;
        const Vec3d away(std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z);
        model.cameras.push_back({"", lookAt(centre + 90 * away, centre, Vec3d::UnitZ(), 0.7, 200, 200), false});
    }
    return model;
}

Mesh surfaceOf(const Model& model) {
    MeshOptions options;
    options.iso = kIso;
    options.colours = false;
    return extractSurface(model, options, silent);
}

double ballVolume(double radius) { return 4.0 / 3 * std::numbers::pi * radius * radius * radius; }

}  // namespace

TEST_CASE("a skin that cameras see from all sides becomes one solid body, where it was") {
    Model model = skinModel(3);
    const Mesh hollow = surfaceOf(model);
    CHECK(measureMesh(hollow).pieces == 2);  // of the skin, its outer face and its inner one

    CHECK(makeUnseenSolid(model, kIso, silent) > 3000);  // the hollow holds some 5000 voxels, and no light comes there
    const MeshMeasures solid = measureMesh(surfaceOf(model));
    CHECK(solid.closed());
    CHECK(solid.pieces == 1);
    CHECK(solid.euler == 2);
    // No voxel that could be seen from outside has moved: the surface lies half a voxel around the skin's outermost voxels.
    CHECK(solid.volume > ballVolume(kRadius - 0.5));
    CHECK(solid.volume < ballVolume(kRadius + 1));
    double outermost = 0;
    for (const Vec3f& position : hollow.positions)
        outermost = std::max(outermost, (position.cast<double>() - Vec3d::Constant(kVoxels / 2)).norm());
    for (const Vec3f& position : surfaceOf(model).positions)
        CHECK((position.cast<double>() - Vec3d::Constant(kVoxels / 2)).norm() <= outermost);
}

TEST_CASE("what light comes through stays as it is, and so does all without cameras") {
    Model haze = skinModel(-3);  // six voxels of optical depth 0.05: three quarters of the light come through
    const std::vector<float> before(haze.field.density().begin(), haze.field.density().end());
    // Corners of the box aside, which no camera has in its picture.
    for (ModelCamera& camera : haze.cameras) camera.camera.fx = camera.camera.fy = 120;
    CHECK(makeUnseenSolid(haze, 0.04, silent) == 0);
    CHECK(std::equal(before.begin(), before.end(), haze.field.density().begin()));

    Model alone = skinModel(3, /*has_cameras=*/false);
    CHECK(makeUnseenSolid(alone, kIso, silent) == 0);
    Model held_out = skinModel(3);
    for (ModelCamera& camera : held_out.cameras) camera.held_out = true;
    CHECK(makeUnseenSolid(held_out, kIso, silent) == 0);
}

TEST_CASE("an iso that no voxel reaches makes nothing solid, and no surface is found there") {
    Model model = skinModel(3);
    const std::vector<float> before(model.field.density().begin(), model.field.density().end());
    for (const double iso : {1e9, 0.0, -1.0, std::nan("")}) {
        CAPTURE(iso);
        CHECK(makeUnseenSolid(model, iso, silent) == 0);
        CHECK(std::equal(before.begin(), before.end(), model.field.density().begin()));
    }
    MeshOptions options;
    options.iso = 1e9;
    CHECK_THROWS_WITH(extractSurface(model, options, silent), Catch::Contains("field's maximum"));
}

TEST_CASE("what is unseen does not depend on the number of threads, nor much on that of rays") {
    Model all = skinModel(3), one = skinModel(3), few = skinModel(3);
    const std::size_t raised = makeUnseenSolid(all, kIso, silent);
    {
        const ThreadLimit limit(1);
        CHECK(makeUnseenSolid(one, kIso, silent) == raised);
    }
    CHECK(std::equal(all.field.density().begin(), all.field.density().end(), one.field.density().begin()));
    // 14 x 40000 pixels; a fifth of them still meets every voxel from some side, but a few at the corners of the box.
    CHECK(makeUnseenSolid(few, kIso, silent, {.rays = 112e3}) < raised + raised / 50);
}

TEST_CASE("looking for what is seen can be stopped") {
    class Stop final : public Report {
        bool cancelled() const override { return true; }
    } stop;
    Model model = skinModel(3);
    CHECK_THROWS_AS(makeUnseenSolid(model, kIso, stop), Interrupted);
}
