// SPDX-License-Identifier: Apache-2.0
#include "vdb/shells.h"

#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "vdb/adapt.h"

using namespace nerfvdb;

namespace {

const Vec3i kExtent(16, 8, 24);

/// Whether a point lies in a box, its lower faces included.
bool isIn(const Box& box, const Vec3d& p) {
    return (p.array() >= box.min.array()).all() && (p.array() < box.max.array()).all();
}

}  // namespace

TEST_CASE("world and index coordinates lead to each other in every shell") {
    const VoxelField field = test::nestedField(kExtent, 4, 4);
    const Shells& shells = field.shells();
    for (int shell = 0; shell < shells.count; ++shell) {
        const GridFrame frame = shells.frame(field.frame(), shell);
        CHECK(frame.voxel_size == field.frame().voxel_size * (1 << shell));
        for (const Vec3d& local : {Vec3d(0, 0, 0), Vec3d(3.25, 7.5, 20), Vec3d(16, 8, 24)}) {
            const Vec3d index = shells.corner(shell).cast<double>() + local, world = frame.worldFromIndex(index);
            CHECK((frame.indexFromWorld(world) - index).norm() < 1e-12);
            // The same by way of the inner shell's coordinates.
            CHECK((shells.fromInner(shell, field.frame().indexFromWorld(world)) - index).norm() < 1e-12);
            CHECK(shells.layerAt(static_cast<int>(index.x())) == shell);
        }
    }
    CHECK((shells.fromInner(0, Vec3d(1, 2, 3)) - Vec3d(1, 2, 3)).norm() == 0);
}

TEST_CASE("the boxes of shells have one middle, and each is twice as large as the next smaller one") {
    const VoxelField field = test::nestedField(kExtent, 4, 4);
    const Vec3d centre = field.shellBox(0).center();
    for (int shell = 0; shell < 4; ++shell) {
        const Box box = field.shellBox(shell);
        CHECK((box.center() - centre).norm() < 1e-12);
        CHECK((box.size() - kExtent.cast<double>() * (0.05 * (1 << shell))).norm() < 1e-12);
    }
    CHECK(field.worldBox().size() == field.shellBox(3).size());
}

TEST_CASE("own cells of shells cover every point of the outer box once") {
    const VoxelField field = test::nestedField(kExtent, 3, 4);
    const Shells& shells = field.shells();
    const Box box = field.worldBox();
    for (int i = 0; i < 2000; ++i) {
        Vec3d p;
        for (int axis = 0; axis < 3; ++axis)
            p[axis] = box.min[axis] + box.size()[axis] * unitFloat(static_cast<std::uint32_t>(randomBits(3, axis, i)));
        int n_owners = 0, innermost = 2;
        while (innermost > 0 && isIn(field.shellBox(innermost - 1), p)) --innermost;
        for (int shell = 0; shell < 3; ++shell) {
            const Vec3d index = shells.frame(field.frame(), shell).indexFromWorld(p);
            const Vec3i cell = index.array().floor().cast<int>();
            const Vec3d local = index - shells.corner(shell).cast<double>();
            if ((local.array() < 0).any() || (local.array() >= kExtent.cast<double>().array()).any()) continue;
            const int leaf = field.topology().findLeaf(test::floorLeaf(cell));
            const bool owns = leaf >= 0 && testBit(field.topology().cells()[leaf],
                                                   brickOffset(cell.x() & 7, cell.y() & 7, cell.z() & 7));
            n_owners += owns;
            CHECK(owns == (shell == innermost));
        }
        CHECK(n_owners == 1);
    }
}

TEST_CASE("shells at half the voxel size are in the same places") {
    const VoxelField field = test::nestedField(kExtent, 3, 4);
    const VoxelField fine = refineField(field, subdivide(field.topology(), field.topology().cells()));
    CHECK(fine.topology().cellCount() == 8 * field.topology().cellCount());
    for (int shell = 0; shell < 3; ++shell) {
        CHECK((fine.shellBox(shell).min - field.shellBox(shell).min).norm() < 1e-12);
        CHECK((fine.shellBox(shell).max - field.shellBox(shell).max).norm() < 1e-12);
    }
    CHECK(fine.shells().fits(fine.topology().dims()));
}

TEST_CASE("shells that do not lie side by side do not fit") {
    const Shells good = test::nestedShells(kExtent, 3);
    const Vec3i dims = test::nestedDims(good);
    CHECK(good.fits(dims));
    const auto changed = [&](auto change) {
        Shells shells = good;
        change(shells);
        return shells.fits(dims);
    };
    CHECK(!changed([](Shells& s) { s.count = 0; }));
    CHECK(!changed([](Shells& s) { s.count = kMaxShells + 1; }));
    CHECK(!changed([](Shells& s) { s.count = 4; }));
    CHECK(!changed([](Shells& s) { s.stride = s.extent.x(); }));
    CHECK(!changed([](Shells& s) { s.extent.y() = 0; }));
    CHECK(!changed([&](Shells& s) { s.extent.z() = dims.z(); }));
}
