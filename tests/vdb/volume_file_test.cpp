// SPDX-License-Identifier: Apache-2.0
#include "vdb/volume_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <Eigen/Geometry>
#include <map>
#include <tuple>

#include "core/atomic_file.h"
#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/random_volume.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_dir.h"
#include "vdb/openvdb_grids.h"

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

    // A level set beside it, or a vector, is not what is meant.
    auto surface = fog("surface");
    surface->setGridClass(openvdb::GRID_LEVEL_SET);
    writeForeign(folder / "b.vdb", {surface, openvdb::Vec3SGrid::create(), fog("smoke")});
    const VolumeFile grey = readVolume(folder / "b.vdb");
    CHECK_FALSE(grey.has_color);
    CHECK(valuesOf(grey.volume).at({-3, 4, 5}).color[0] == 1);
}

TEST_CASE("a foreign volume stands where its transform says, turned and scaled") {
    const TempDir folder;
    const Eigen::Matrix3d turn =
        (Eigen::AngleAxisd(0.7, Vec3d(1, -2, 3).normalized()) * Eigen::AngleAxisd(-1.1, Vec3d::UnitX()))
            .toRotationMatrix();
    openvdb::Mat4d matrix = openvdb::Mat4d::identity();  // acts on rows
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column)
            matrix(row, column) = static_cast<float>(0.3 * turn(column, row));  // as single precision leaves it
    matrix.setTranslation(openvdb::Vec3d(4, 5, -6));
    const auto density = fog();
    density->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
    const auto color = openvdb::Vec3SGrid::create();
    color->setName("color");
    color->setTransform(density->transform().copy());
    writeForeign(folder / "a.vdb", {density, color});
    const Volume volume = readVolume(folder / "a.vdb").volume;
    CHECK(volume.frame().voxel_size == Approx(0.3));
    for (const openvdb::Coord& ijk : {openvdb::Coord(0), openvdb::Coord(-3, 4, 5), openvdb::Coord(900, -800, 700)}) {
        const openvdb::Vec3d expected = density->indexToWorld(ijk);
        const Vec3d own = (Vec3i(ijk.x(), ijk.y(), ijk.z()) - volume.firstVoxel()).cast<double>();
        const Vec3d found = volume.worldFromGrid().apply(volume.frame().worldFromIndex(own));
        CHECK((found - Vec3d(expected.asPointer())).norm() < 1e-3 * 0.3);
    }
    // Light crosses three tenths of a unit where it crosses a voxel, turned or not.
    CHECK(*std::max_element(volume.sigma().begin(), volume.sigma().end()) == 2);

    // The same place up to rounding is the same place; a fifth of a voxel beside is not.
    const auto plain = fog();
    color->setTransform(openvdb::math::Transform::createLinearTransform(0.2500005));
    REQUIRE(color->transform() != plain->transform());
    writeForeign(folder / "b.vdb", {plain, color});
    CHECK(readVolume(folder / "b.vdb").has_color);
    color->transform().postTranslate(openvdb::Vec3d(0.05, 0, 0));
    writeForeign(folder / "b.vdb", {plain, color});
    CHECK_THROWS_WITH(readVolume(folder / "b.vdb"), Contains("color") && Contains("another transform"));
}

TEST_CASE("values are kept as half where half can say them, else as float") {
    const TempDir folder;
    for (const bool is_bright : {false, true})
        for (const bool is_dense : {false, true}) {
            Volume volume = test::randomVolume();
            const std::span<float> sigma = volume.sigma();
            const auto i = static_cast<std::size_t>(std::max_element(sigma.begin(), sigma.end()) - sigma.begin());
            if (is_dense) sigma[i] = 7e4f;
            if (is_bright) volume.color()[i * Volume::kChannels] = 7e4f;
            CHECK(writeVolume(folder / "a.vdb", volume, {}).half == !is_dense);
            const auto before = valuesOf(volume), after = valuesOf(readVolume(folder / "a.vdb").volume);
            REQUIRE(before.size() == after.size());
            double worst_sigma = 0, worst_color = 0;  // relative
            for (const auto& [at, value] : before) {
                const Values& found = after.at(at);
                if (value.sigma > 0)
                    worst_sigma = std::max<double>(worst_sigma, std::abs(found.sigma / value.sigma - 1));
                worst_color = std::max<double>(worst_color, std::abs(found.color[0] / value.color[0] - 1));
            }
            // 11 bits of half, or all of float.
            CHECK(worst_sigma <= (is_dense ? 0 : 0x1p-11));
            CHECK(worst_color <= (is_bright ? 0 : 0x1p-11));
            CHECK(is_dense == (worst_sigma == 0));
            CHECK(is_bright == (worst_color == 0));
        }
}

TEST_CASE("a volume that finds no room leaves what stood there") {
    const TempDir folder;
    writeVolume(folder / "a.vdb", test::randomVolume(), {});
    const std::string before = readFile(folder / "a.vdb");
    {
        const SmallDisk disk(before.size() / 2);
        CHECK_THROWS_WITH(writeVolume(folder / "a.vdb", test::randomVolume(0.1, 20.0f, 7), {}),
                          Contains("a.vdb") && Contains("File too large"));
    }
    const bool is_untouched = readFile(folder / "a.vdb") == before;
    CHECK(is_untouched);
    CHECK(std::distance(fs::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("another program's volume that was cut short is refused, wherever it was cut") {
    const TempDir folder;
    const auto density = fog();
    for (int i = 0; i < 3000; ++i)
        density->tree().setValueOn({i * 7 % 31, i * 13 % 37, i * 5 % 41}, 1 + 0.001f * static_cast<float>(i));
    writeForeign(folder / "whole.vdb", {density});
    CHECK(valuesOf(readVolume(folder / "whole.vdb").volume).size() > 3000);
    const std::string bytes = readFile(folder / "whole.vdb");
    int n_cut = 0;
    for (std::size_t size = 0; size < bytes.size(); size += bytes.size() / 97 + 1, ++n_cut) {
        CAPTURE(size);
        std::ofstream(folder / "cut.vdb", std::ios::binary) << bytes.substr(0, size);
        CHECK_THROWS_AS(readVolume(folder / "cut.vdb"), DataError);
    }
    CHECK(n_cut > 50);
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
    auto doubled = openvdb::DoubleGrid::create(0.0);
    doubled->setName("density");
    refused({doubled, fog("heat")}, "'density' (double), 'heat' (float), expected a float grid 'density'");
    auto surface = fog("surface");
    surface->setGridClass(openvdb::GRID_LEVEL_SET);
    refused({surface}, "'surface' (float, level set)");
    auto everywhere = openvdb::FloatGrid::create(0.5f);
    everywhere->setName("density");
    refused({everywhere}, "endless fog");
    for (const float bad : {-0.5f, NAN, INFINITY}) {
        auto color = openvdb::Vec3SGrid::create();
        color->setName("Cd");
        color->setTransform(fog()->transform().copy());
        color->tree().setValueOn(openvdb::Coord(-3, 4, 5), openvdb::Vec3s(0, bad, 0));
        refused({fog(), color}, "negative or not finite");
    }
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
    auto sheared = fog();
    sheared->transform().preShear(0.1, openvdb::math::X_AXIS, openvdb::math::Y_AXIS);
    refused({sheared}, "no cubes");
    auto tapered = fog();
    tapered->setTransform(openvdb::math::Transform::createFrustumTransform(
        openvdb::BBoxd(openvdb::Vec3d(-10), openvdb::Vec3d(10)), 0.5, 20, 1));
    refused({tapered}, "no cubes");
    auto elsewhere = openvdb::Vec3SGrid::create();
    elsewhere->setName("color");
    refused({fog(), elsewhere}, "another transform");
    auto endless = fog();
    endless->fill(openvdb::CoordBBox(openvdb::Coord(0), openvdb::Coord(4095)), 1.0f);
    refused({endless}, "active voxels");
    auto scattered = fog();
    scattered->tree().setValueOn(openvdb::Coord(1 << 20, 1 << 20, 1 << 20), 1.0f);
    refused({scattered}, "leaves of 8^3");

    std::ofstream(folder / "bad.vdb") << "no volume";
    CHECK_THROWS_WITH(readVolume(folder / "bad.vdb"), Contains("no .vdb file"));
    writeVolume(folder / "bad.vdb", test::randomVolume(), {});
    fs::resize_file(folder / "bad.vdb", fs::file_size(folder / "bad.vdb") - 100);
    CHECK_THROWS_WITH(readVolume(folder / "bad.vdb"), Contains("damaged or truncated"));
    CHECK_THROWS_AS(readVolume(folder / "absent.vdb"), IoError);
}
