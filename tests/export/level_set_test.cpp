// SPDX-License-Identifier: Apache-2.0
#include "export/level_set.h"

#include <openvdb/tools/Interpolation.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"
#include "tests/support/temp_dir.h"
#include "vdb/openvdb_grids.h"

using namespace nerfvdb;

namespace {

const Vec3d kCentre(0.2, -0.4, 1.1);
constexpr double kRadius = 0.9, kVoxel = 0.1;

/// A solid ball, raw density falling linearly through its surface.
Mesh ballMesh() {
    const Vec3i dims(32, 32, 32);
    const GridFrame frame{kCentre - Vec3d::Constant(1.55), kVoxel};
    Model model = test::modelOf(
        test::makeTopology(dims, Vec3i::Zero(), Vec3i::Constant(31), [](const Vec3i&) { return true; }), frame);
    test::setDensity(model.field, [&](const Vec3i& ijk) {
        return static_cast<float>(4 * (kRadius - (frame.worldFromIndex(ijk.cast<double>()) - kCentre).norm()));
    });
    return test::extract(model);
}

}  // namespace

TEST_CASE("a level set holds the signed distance to the surface, where the export stands") {
    const TempDir folder;
    Similarity placement;
    placement.scale = 3;
    placement.rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    placement.translation = Vec3d(5, 6, 7);
    const std::size_t n = writeLevelSet(folder / "a.vdb", ballMesh(), kVoxel, placement);

    openvdb::initialize();
    openvdb::io::File file((folder / "a.vdb").string());
    file.open(false);
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("surface"));
    REQUIRE(grid);
    CHECK(grid->getGridClass() == openvdb::GRID_LEVEL_SET);
    CHECK(grid->activeVoxelCount() == n);
    CHECK(grid->background() == Approx(3 * 3 * kVoxel));
    const Vec3d centre = placement.apply(kCentre);
    double worst = 0;
    for (auto value = grid->cbeginValueOn(); value; ++value) {
        const Vec3d at(grid->indexToWorld(value.getCoord()).asPointer());
        worst = std::max(worst, std::abs(*value - ((at - centre).norm() - 3 * kRadius)));
    }
    // Facets of a ball of nine voxels stand 0.04 voxels off it; OpenVDB measures to the triangles near by.
    CHECK(worst < 0.15 * 3 * kVoxel);
    CHECK(grid->tree().getValue(openvdb::Coord::round(grid->worldToIndex(openvdb::Vec3d(centre.data())))) < 0);

    const ThreadLimit one(1);
    writeLevelSet(folder / "b.vdb", ballMesh(), kVoxel, placement);
    CHECK(readFile(folder / "a.vdb") == readFile(folder / "b.vdb"));
}

TEST_CASE("what has no inside has no level set") {
    const TempDir folder;
    CHECK_THROWS_AS(writeLevelSet(folder / "a.vdb", Mesh{}, kVoxel, {}), DataError);
    Mesh open = ballMesh();
    open.triangles.pop_back();
    CHECK_THROWS_WITH(writeLevelSet(folder / "a.vdb", open, kVoxel, {}), Catch::Contains("3 edges"));
    CHECK_FALSE(std::filesystem::exists(folder / "a.vdb"));
}
