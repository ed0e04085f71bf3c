// SPDX-License-Identifier: Apache-2.0
#include "trainer/resolved_regions.h"

#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"

using namespace nerfvdb;

namespace {

/// A wall across the middle of the inner box, in voxels of 0.05.
VoxelField wall() {
    VoxelField field = test::nestedField(Vec3i::Constant(32), 2, 4);
    const double z = field.shellBox(0).center().z();
    test::setNested(field, [&](const Vec3d& p) { return std::abs(p.z() - z) < 0.06 ? 5.0 : -20.0; });
    return field;
}

/// One half of the wall is seen from a distance of 0.3, where a pixel spans 0.003, the other from 5, where it spans 0.05.
Dataset nearAndFar(const VoxelField& field) {
    const Vec3d centre = field.shellBox(0).center();
    Dataset dataset;
    const auto lookDown = [&](const Vec3d& target, double distance, double fov) {
        View view;
        view.camera = lookAt(target + Vec3d(0, 0, distance), target, Vec3d::UnitY(), fov, 60, 60);
        view.camera.fx = view.camera.fy = 100;
        dataset.views.push_back(view);
    };
    for (const double y : {-0.4, 0.4}) lookDown(centre + Vec3d(-0.4, y, 0), 0.3, 0.6);
    lookDown(centre + Vec3d(1.2, 0, 0), 5, 0.6);
    return dataset;
}

}  // namespace

TEST_CASE("cells are halved where photographs resolve more than they hold, and nowhere else") {
    VoxelField field = wall();
    const Dataset dataset = nearAndFar(field);
    const auto regionsOf = [&](double shrink) {
        return resolvedRegions(dataset, field, findOccupied(field, 0.01f), 0.05f, shrink);
    };
    const std::shared_ptr<const Regions> regions = regionsOf(1);
    REQUIRE(regions);
    CHECK(regions->dims == Vec3i::Constant(4));
    std::size_t n_near = 0, n_far = 0, n_outer = 0;
    for (int shell = 0; shell < 2; ++shell)
        for (int x = 0; x < 4; ++x)
            for (int y = 0; y < 4; ++y)
                for (int z = 0; z < 4; ++z)
                    if (regions->at(shell, {x, y, z}) > 0) ++(shell > 0 ? n_outer : x < 2 ? n_near : n_far);
    // The wall lies on the border between two layers of regions, and is a voxel thick on either side.
    CHECK(n_near >= 4);
    CHECK(n_near <= 2 * 4 * 2);
    CHECK(n_far == 0);
    CHECK(n_outer == 0);
    CHECK_FALSE(regionsOf(16));  // voxels that will be as small as pixels anyway
    const ThreadLimit one_thread(1);
    CHECK(regionsOf(1)->halvings == regions->halvings);

    // Halved already, they are halved again while they are too wide, and no more often than allowed.
    for (int most = 1; most <= kMostHalvings; ++most) {
        Shells shells = field.shells();
        shells.regions = regionsOf(1);
        REQUIRE(shells.regions);
        CHECK(shells.regions->most == most);
        Topology halved = halveRegions(field.topology(), field.shells(), shells);
        field = halveField(std::move(field), std::move(halved), shells);
    }
    CHECK_FALSE(regionsOf(1));
}

TEST_CASE("a field in one box has no regions") {
    VoxelField field = test::nestedField(Vec3i::Constant(32), 1, 4);
    for (float& raw : field.density()) raw = 5;
    CHECK_FALSE(resolvedRegions(nearAndFar(field), field, findOccupied(field, 0.01f), 0.05f, 1));
}
