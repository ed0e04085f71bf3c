// SPDX-License-Identifier: Apache-2.0
#include "trainer/possible_cells.h"

#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"

namespace nerfvdb {
namespace {

/// Calls use(center in world units, whether the cell is possible) for each cell of the grid's box, shell by shell.
template <typename Use>
void forEachCell(const BoxGrid& grid, const std::vector<Topology::LeafCells>& possible, int shell, const Use& use) {
    std::map<std::tuple<int, int, int>, LeafMask> masks;
    for (const Topology::LeafCells& entry : possible) masks[{entry.leaf.x(), entry.leaf.y(), entry.leaf.z()}] = entry.cells;
    const GridFrame frame = grid.shells.frame(grid.frame, shell);
    for (int x = 0; x < grid.shells.extent.x(); ++x)
        for (int y = 0; y < grid.shells.extent.y(); ++y)
            for (int z = 0; z < grid.shells.extent.z(); ++z) {
                const int i = x + shell * grid.shells.stride;
                const auto mask = masks.find({i / kLeafDim, y / kLeafDim, z / kLeafDim});
                const int offset = (i % kLeafDim * kLeafDim + y % kLeafDim) * kLeafDim + z % kLeafDim;
                use(frame.worldFromIndex(Vec3d(i + 0.5, y + 0.5, z + 0.5)),
                    mask != masks.end() && testBit(mask->second, offset));
            }
}

Dataset ring() {
    Dataset dataset;
    for (int n = 0; n < 12; ++n) {
        const double around = 2 * std::numbers::pi * n / 12;
        View view;
        view.camera = lookAt({4 * std::cos(around), 4 * std::sin(around), 0.5}, Vec3d::Zero(), Vec3d::UnitZ(), 0.8, 80, 60);
        dataset.views.push_back(view);
    }
    return dataset;
}

/// How many pictures show a point, from the definition; -1: it is within `nearest` of a camera.
int viewsThatShow(const Dataset& dataset, const Vec3d& point, double nearest) {
    int count = 0;
    for (const View& view : dataset.views) {
        if ((point - view.camera.position).norm() < nearest) return -1;
        const auto pixel = projectPoint(view.camera, point);
        count += pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < view.camera.width &&
                 pixel->y() < view.camera.height;
    }
    return count;
}

}  // namespace

TEST_CASE("grids cover their box with voxels of the size asked for") {
    const Box box{Vec3d(1, 2, 3), Vec3d(5, 4, 4)};
    const BoxGrid by_count = gridOver(box, 64);
    CHECK(by_count.frame.voxel_size == Approx(4.0 / 63));
    CHECK(by_count.dims == Vec3i(64, 40, 24));
    const BoxGrid by_size = gridOfVoxels(box, 0.25);
    CHECK(by_size.dims == Vec3i(24, 16, 8));
    for (const BoxGrid& grid : {by_count, by_size}) {
        const Vec3d last = grid.frame.worldFromIndex((grid.dims - Vec3i::Ones()).cast<double>());
        CHECK((grid.frame.origin.array() <= box.min.array() + 1e-9).all());
        CHECK((last.array() >= box.max.array() - 1e-9).all());
    }
    const BoxGrid around = gridAround(box, 0.25, 3);
    CHECK(around.shells.count == 3);
    CHECK(around.shells.extent == Vec3i(16, 8, 8));
    CHECK(around.shells.fits(around.dims));
}

TEST_CASE("no cell of the object is ruled out by its masks, and most of what is outside is") {
    const Dataset dataset = test::surroundedSphereDataset(24, 64);
    const auto scene = makeSyntheticScene("sphere");
    const BoxGrid grid = gridOver({Vec3d::Constant(-1.2), Vec3d::Constant(1.2)}, 32);
    int n_lost = 0, n_inside = 0, n_outside = 0, n_kept = 0;
    forEachCell(grid, possibleCells(dataset, grid, 2), 0, [&](const Vec3d& center, bool is_possible) {
        const bool is_filled = scene->density(center) > 0;
        n_inside += is_filled;
        n_lost += is_filled && !is_possible;
        const bool is_far = center.norm() > 1.1;
        n_outside += is_far;
        n_kept += is_far && is_possible;
    });
    CHECK(n_inside > 1000);
    CHECK(n_lost == 0);
    CHECK(n_outside > 1000);
    CHECK(n_kept == 0);
}

TEST_CASE("cells of shells are those that enough cameras see and none stands next to") {
    const Dataset dataset = ring();
    const BoxGrid grid = gridAround({Vec3d::Constant(-2), Vec3d::Constant(2)}, 0.25, 3);
    const double nearest = 0.01 * 4;
    for (const std::size_t min_views : {std::size_t{2}, std::size_t{5}}) {
        const auto possible = possibleCells(dataset, grid, min_views);
        for (int shell = 0; shell < 3; ++shell) {
            const double hole = shell == 0 ? 0 : std::ldexp(1.0, shell);  // half the side of what the next smaller one covers
            int n_wrong = 0, n_possible = 0;
            forEachCell(grid, possible, shell, [&](const Vec3d& center, bool is_possible) {
                const bool is_own = center.cwiseAbs().maxCoeff() > hole;
                const int views = viewsThatShow(dataset, center, nearest);
                n_wrong += is_possible != (is_own && views >= static_cast<int>(min_views));
                n_possible += is_possible;
            });
            CAPTURE(shell, min_views);
            CHECK(n_wrong == 0);
            if (shell < 2) CHECK(n_possible > 100);
        }
    }
}

}  // namespace nerfvdb
