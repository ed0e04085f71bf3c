// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_file.h"

#include <openvdb/openvdb.h>

#include <cmath>
#include <fstream>
#include <map>
#include <tuple>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/random_volume.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Values by the coordinates that a volume was made with.
struct Values {
    float sigma;
    float color[3];
};

std::map<std::tuple<int, int, int>, Values> valuesOf(const Volume& volume) {
    std::map<std::tuple<int, int, int>, Values> values;
    for (std::size_t leaf = 0; leaf < volume.topology().leafCount(); ++leaf)
        forEachBit(volume.topology().voxels()[leaf], [&](int offset) {
            const Vec3i at = test::givenVoxel(volume, leaf, offset);
            const std::size_t i = leaf * kLeafVoxels + offset;
            const float* color = &volume.color()[i * Volume::kChannels];
            values[{at.x(), at.y(), at.z()}] = {volume.sigma()[i], {color[0], color[1], color[2]}};
        });
    return values;
}

/// A file as another program writes it.
void writeForeign(const fs::path& path, const openvdb::GridPtrVec& grids) {
    openvdb::initialize();
    openvdb::io::File file(path.string());
    file.write(grids);
    file.close();
}

openvdb::FloatGrid::Ptr fog(const std::string& name = "density") {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->setName(name);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->tree().setValueOn(openvdb::Coord(-3, 4, 5), 2.0f);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.25));
    return grid;
}

}  // namespace

TEST_CASE("a volume comes back from its file, wherever it was put") {
    const TempDir folder;
    Similarity turned;
    turned.scale = 3;
    turned.rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    turned.translation = Vec3d(5, -6, 7);
    for (const bool is_turned : {false, true}) {
        Volume volume = test::randomVolume();
        if (is_turned) volume.place(turned);
        WriteVolumeOptions options;
        options.half = false;
        options.background = Vec3f(0.1f, 0.2f, 0.3f);
        const WrittenVolume written = writeVolume(folder / "a.vdb", volume, options);
        CHECK(written.bytes == fs::file_size(folder / "a.vdb"));
        CHECK_FALSE(written.half);
        const VolumeFile read = readVolume(folder / "a.vdb");
        CHECK(read.has_color);
        CHECK(read.background == options.background);
        CHECK(read.volume.frame().voxel_size == Approx(volume.frame().voxel_size));

        const auto before = valuesOf(volume), after = valuesOf(read.volume);
        CHECK(before.size() == after.size());
        std::size_t n_active = 0, wrong = 0;
        for (const auto& [at, value] : before) {
            const auto found = after.find(at);
            n_active += value.sigma > 0;
            wrong += found == after.end() || found->second.sigma != value.sigma ||
                     !std::equal(value.color, value.color + 3, found->second.color);
        }
        CHECK(wrong == 0);
        CHECK(n_active == written.active_voxels);
        // The same voxel lies at the same place of the world.
        const auto worldOf = [](const Volume& v, const Vec3i& given) {
            return v.worldFromGrid().apply(v.frame().worldFromIndex((given - v.firstVoxel()).cast<double>()));
        };
        for (const Vec3i& given : {Vec3i(-12, 3, 4), Vec3i(0, 0, 0), Vec3i(7, -8, 20)})
            CHECK((worldOf(read.volume, given) - worldOf(volume, given)).norm() < 1e-9);

        writeVolume(folder / "b.vdb", volume, options);
        const bool repeats = readFile(folder / "a.vdb") == readFile(folder / "b.vdb");
        CHECK(repeats);
    }
}

TEST_CASE("volumes of other programs are read: Cd, tiles, negative coordinates, another name, no colour") {
    const TempDir folder;
    const auto density = fog();
    density->fill(openvdb::CoordBBox(openvdb::Coord(64), openvdb::Coord(64 + 15)), 0.5f);  // may become tiles
    density->tree().prune();
    auto color = openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0f));
    color->setName("Cd");
    color->setTransform(density->transformPtr()->copy());
    color->tree().setValueOn(openvdb::Coord(-3, 4, 5), openvdb::Vec3s(0.25f, 0.5f, 0.75f));
    writeForeign(folder / "a.vdb", {color, density});
    const VolumeFile read = readVolume(folder / "a.vdb");
    CHECK(read.has_color);
    CHECK_FALSE(read.background.has_value());
    const auto values = valuesOf(read.volume);
    CHECK(values.at({-3, 4, 5}).sigma == 2);
    CHECK(values.at({-3, 4, 5}).color[2] == 0.75f);
    CHECK(values.at({70, 70, 70}).sigma == 0.5f);
    CHECK(read.volume.givenFrame().voxel_size == Approx(0.25));

    writeForeign(folder / "b.vdb", {fog("smoke")});
    const VolumeFile grey = readVolume(folder / "b.vdb");
    CHECK_FALSE(grey.has_color);
    CHECK(valuesOf(grey.volume).at({-3, 4, 5}).color[0] == 1);
}

TEST_CASE("what is no volume is refused with a reason") {
    const TempDir folder;
    const auto refused = [&](const openvdb::GridPtrVec& grids, const std::string& reason) {
        CAPTURE(reason);
        writeForeign(folder / "bad.vdb", grids);
        CHECK_THROWS_AS(readVolume(folder / "bad.vdb"), DataError);
        CHECK_THROWS_WITH(readVolume(folder / "bad.vdb"), Contains("bad.vdb") && Contains(reason));
    };
    refused({}, "no grids");
    refused({openvdb::Vec3SGrid::create()}, "vec3s");
    refused({fog("a"), fog("b")}, "'a'");
    auto level_set = fog();
    level_set->setGridClass(openvdb::GRID_LEVEL_SET);
    refused({level_set}, "a level set");
    for (const float bad : {-1.0f, NAN, INFINITY}) {
        auto grid = fog();
        grid->tree().setValueOn(openvdb::Coord(-3, 4, 5), bad);
        refused({grid}, "negative or not finite");
    }
    auto stretched = fog();
    stretched->transform().preScale(openvdb::Vec3d(1, 1, 2));
    refused({stretched}, "no cubes");
    auto mirrored = fog();
    mirrored->transform().preScale(openvdb::Vec3d(1, 1, -1));
    refused({mirrored}, "no cubes");
    auto elsewhere = openvdb::Vec3SGrid::create();
    elsewhere->setName("color");
    refused({fog(), elsewhere}, "another transform");
    auto endless = fog();
    endless->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(4095)), 1.0f);
    refused({endless}, "active voxels");

    std::ofstream(folder / "bad.vdb") << "no volume";
    CHECK_THROWS_WITH(readVolume(folder / "bad.vdb"), Contains("no .vdb file"));
    writeVolume(folder / "bad.vdb", test::randomVolume(), {});
    fs::resize_file(folder / "bad.vdb", fs::file_size(folder / "bad.vdb") - 100);
    CHECK_THROWS_WITH(readVolume(folder / "bad.vdb"), Contains("damaged or truncated"));
    CHECK_THROWS_AS(readVolume(folder / "absent.vdb"), IoError);
}
