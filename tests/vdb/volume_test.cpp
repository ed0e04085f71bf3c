// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume.h"

#include <set>
#include <tuple>

#include "core/error.h"
#include "core/metrics.h"
#include "tests/support/catch.h"
#include "tests/support/random_volume.h"
#include "vdb/volume_renderer.h"

using namespace nerfvdb;

namespace {

/// A value at a voxel, in the coordinates that the volume was made with.
float sigmaAt(const Volume& volume, const Vec3i& voxel) {
    const Vec3i at = voxel - volume.firstVoxel();
    const int leaf = volume.topology().findLeaf(at / kLeafDim);
    return leaf < 0 ? 0.0f
                    : volume.sigma()[static_cast<std::size_t>(leaf) * kLeafVoxels +
                                     brickOffset(at.x() & 7, at.y() & 7, at.z() & 7)];
}

}  // namespace

TEST_CASE("a volume has a cell wherever one of eight corners is active, and says where it lies") {
    Topology::LeafCells one{Vec3i(-1, 0, 0), {}};
    setBit(one.cells, brickOffset(7, 0, 3));  // voxel (-1, 0, 3)
    const Volume volume(std::vector{one}, {Vec3d(10, 20, 30), 0.5});
    CHECK(volume.topology().cellCount() == 8);
    CHECK(volume.topology().voxelCount() == 27);
    std::size_t n_active = 0;
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.active()[leaf], [&](int offset) {
            ++n_active;
            CHECK(test::givenVoxel(volume, leaf, offset) == Vec3i(-1, 0, 3));
        });
    CHECK(n_active == 1);
    // (-1, 0, 3) in the given frame: the same place in the volume's own.
    const Vec3i own = Vec3i(-1, 0, 3) - volume.firstVoxel();
    CHECK(volume.frame().worldFromIndex(own.cast<double>()) == Vec3d(9.5, 20, 31.5));
    CHECK(volume.givenFrame().origin == Vec3d(10, 20, 30));
}

TEST_CASE("an empty volume is empty, and one spread over the world is refused") {
    const Volume nothing(std::span<const Topology::LeafCells>{}, {});
    CHECK(nothing.topology().voxelCount() == 0);
    CHECK(allCells(nothing).cellCount() == 0);
    Topology::LeafCells here{Vec3i::Zero(), {}}, there{Vec3i(1 << 20, 1 << 20, 1 << 20), {}};
    setBit(here.cells, 0);
    setBit(there.cells, 0);
    CHECK_THROWS_WITH(Volume(std::vector{here, there}, {}),
                      Catch::Contains("1048579 x 1048579 x 1048579 leaves") && Catch::Contains("2^28"));
    there.leaf = Vec3i(1 << 28, 0, 0);  // a box of a few leaves across, as long as OpenVDB can say
    CHECK_THROWS_AS(Volume(std::vector{here, there}, {}), DataError);
}

TEST_CASE("cells of a volume are those with an active corner, those of no other, whatever its coordinates") {
    const Volume volume = test::randomVolume();
    std::set<std::tuple<int, int, int>> active, cells;
    const auto collect = [&](std::span<const LeafMask> masks, std::set<std::tuple<int, int, int>>& into) {
        for (std::size_t leaf = 0; leaf < masks.size(); ++leaf)
            forEachBit(masks[leaf], [&](int offset) {
                const Vec3i at = test::givenVoxel(volume, leaf, offset);
                into.insert({at.x(), at.y(), at.z()});
            });
    };
    collect(volume.active(), active);
    collect(volume.topology().cells(), cells);
    int wrong = 0, n_empty = 0;
    for (int x = -16; x < 16; ++x)
        for (int y = -12; y < 20; ++y)
            for (int z = -4; z < 28; ++z) {
                bool expected = false;
                for (int n = 0; n < 8; ++n)
                    expected |= active.contains({x + (n >> 2 & 1), y + (n >> 1 & 1), z + (n & 1)});
                wrong += cells.contains({x, y, z}) != expected;
                n_empty += !expected;
            }
    CHECK(wrong == 0);
    CHECK(n_empty > 1000);
    CHECK(active.size() > 5000);
}

TEST_CASE("a volume of more leaves than the kernels can number values of is refused", "[slow]") {
    // One voxel in each third leaf has cells in eight leaves: 81^3 * 8 > 2^22.
    constexpr int kLeavesPerAxis = 81;
    std::vector<Topology::LeafCells> active;
    for (int x = 0; x < kLeavesPerAxis; ++x)
        for (int y = 0; y < kLeavesPerAxis; ++y)
            for (int z = 0; z < kLeavesPerAxis; ++z) {
                active.push_back({3 * Vec3i(x, y, z), {}});
                setBit(active.back().cells, 0);
            }
    CHECK_THROWS_WITH(Volume(active, {}), Catch::Contains("4251528 leaves") && Catch::Contains("at most 2^22"));
}

TEST_CASE("restricted to some voxels, a volume has their values, and colours around them") {
    const Volume whole = test::randomVolume();
    std::vector<LeafMask> keep(whole.active().begin(), whole.active().end());
    for (std::size_t leaf = 0; leaf < keep.size(); ++leaf)
        for (std::uint64_t& word : keep[leaf]) word = whole.topology().leafCoords()[leaf].x() < 3 ? word : 0;
    const Volume part = whole.restricted(keep);
    CHECK(part.givenFrame().origin.isApprox(whole.givenFrame().origin));
    std::size_t n = 0, n_whole = 0, wrong = 0, black = 0;
    for (std::size_t leaf = 0; leaf < part.topology().leafCount(); ++leaf)
        forEachBit(part.topology().voxels()[leaf], [&](int offset) {
            const std::size_t i = leaf * kLeafVoxels + offset;
            const bool is_active = testBit(part.active()[leaf], offset);
            n += is_active;
            wrong += part.sigma()[i] != (is_active ? sigmaAt(whole, test::givenVoxel(part, leaf, offset)) : 0.0f);
            black += part.color()[i * Volume::kChannels] == 0;
        });
    for (const LeafMask& mask : whole.active()) forEachBit(mask, [&](int) { ++n_whole; });
    CHECK(wrong == 0);
    CHECK(black == 0);
    CHECK(n > 0.2 * static_cast<double>(n_whole));
    CHECK(n < 0.9 * static_cast<double>(n_whole));
}

TEST_CASE("a volume that is turned, scaled and moved looks the same from a camera that went along") {
    const Volume volume = test::randomVolume();
    const Camera camera = lookAt(Vec3d(4, 3, 5), Vec3d(0.5, -0.5, 3.2), Vec3d::UnitZ(), 0.8, 40, 30);
    const RenderedImage before = VolumeRenderer(volume, {}).render(camera);
    CHECK(*std::max_element(before.opacity.pixels.begin(), before.opacity.pixels.end()) > 0.9f);
    Similarity placement;
    placement.scale = 7;
    placement.translation = Vec3d(-3, 11, 0.25);
    for (const bool is_turned : {false, true}) {
        if (is_turned) placement.rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
        Volume placed = test::randomVolume();
        placed.place(placement);
        CHECK(placed.frame().voxel_size == Approx(0.7));
        const RenderedImage after = VolumeRenderer(placed, {}).render(placement.apply(camera));
        CHECK(psnr(after.rgb, before.rgb) > 80);  // float rounding of sigma and of rays
        CHECK(*after.depth.at(20, 15) == Approx(7 * *before.depth.at(20, 15)).epsilon(1e-3));
    }
    // And back again.
    Volume there = test::randomVolume();
    there.place(placement);
    there.place(placement.inverse());
    CHECK(psnr(VolumeRenderer(there, {}).render(camera).rgb, before.rgb) > 80);
}
