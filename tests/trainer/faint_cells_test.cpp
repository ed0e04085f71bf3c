// SPDX-License-Identifier: Apache-2.0
#include "trainer/faint_cells.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "vdb/occupancy.h"

using namespace nerfvdb;

namespace {

constexpr int kEdge = 64;  // voxels
constexpr float kColdRaw = -30;

/// One camera in front of a box of 2 world units, which fills its picture.
Dataset oneView() {
    Dataset dataset;
    View view{lookAt({-8, 0, 0}, Vec3d::Zero(), Vec3d::UnitZ(), 0.18, 32, 32), "view", {}};
    view.photo.width = view.photo.height = 32;
    view.photo.pixels.assign(32 * 32, {0, 0, 0, 255});
    dataset.views.push_back(std::move(view));
    return dataset;
}

/// The box, each cell of it, with the given raw densities; learned per world unit.
VoxelField box(const std::function<float(const Vec3i&)>& raw) {
    const Vec3i dims = Vec3i::Constant(kEdge);
    VoxelField field(test::makeTopology(dims, Vec3i::Zero(), dims - Vec3i::Ones(), [](const Vec3i&) { return true; }),
                     {Vec3d::Constant(-1), 2.0 / (kEdge - 1)}, 4, 1.0);
    test::setDensity(field, raw);
    return field;
}

float chosen(const VoxelField& field) {
    const Dataset dataset = oneView();
    RaySource source(dataset, 5);
    source.update(field, findOccupied(field, 0));
    return chooseMinAlpha(field, source, 17);
}

/// Raw density at which the box has this optical depth from side to side.
float rawFor(double depth) { return static_cast<float>(std::log(depth / 2)); }

}  // namespace

TEST_CASE("even fog is kept as soon as all of it together hides something") {
    // Over 63 voxels: depth 0.004 lets 0.4 % more light pass if it is passed by, less than half a percent; all others more, at
    // alpha depth / 63 a voxel.
    CHECK(chosen(box([](const Vec3i&) { return rawFor(0.004); })) == 0.01f);
    for (const double depth : {0.01, 0.08, 0.3, 0.6}) {
        const float min_alpha = chosen(box([&](const Vec3i&) { return rawFor(depth); }));
        CAPTURE(depth, min_alpha);
        CHECK(min_alpha < depth / 63);
        CHECK(min_alpha > depth / 63 / 2);  // and no smaller a threshold than needed
    }
}

TEST_CASE("fog before a wall counts by what it hides, a tenth, and not by what passes it") {
    const auto fogBeforeWall = [](double depth) {
        return [depth](const Vec3i& ijk) { return ijk.x() > 60 ? 6.0f : rawFor(depth); };
    };
    CHECK(chosen(box(fogBeforeWall(0.08))) == 0.01f);
    CHECK(chosen(box(fogBeforeWall(0.15))) < 0.15 / 63);
}

TEST_CASE("what stands before fog hides it, and a few rays' worth of it does not count") {
    // An opaque wall at the side of the camera.
    CHECK(chosen(box([](const Vec3i& ijk) { return ijk.x() < 6 ? 6.0f : rawFor(0.3); })) == 0.01f);
    // Fog in less than a hundredth of the picture.
    CHECK(chosen(box([](const Vec3i& ijk) {
              return ijk.y() < 5 && ijk.z() < 5 ? rawFor(0.5) : ijk.x() > 60 ? 6.0f : kColdRaw;
          })) == 0.01f);
    // The same fog everywhere.
    CHECK(chosen(box([](const Vec3i& ijk) { return ijk.x() > 60 ? 6.0f : rawFor(0.5); })) < 0.5 / 63);
}

TEST_CASE("without rays, or with nothing to see, the threshold is the largest") {
    const VoxelField field = box([](const Vec3i&) { return kColdRaw; });
    CHECK(chosen(field) == 0.01f);
    const Dataset dataset = oneView();
    CHECK(chooseMinAlpha(field, RaySource(dataset, 1), 0) == 0.01f);
}
