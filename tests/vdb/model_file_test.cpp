// SPDX-License-Identifier: Apache-2.0
#include "vdb/model_file.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdlib>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/support/nested_field.h"
#include "tests/support/shell_model.h"
#include "tests/support/temp_dir.h"
#include "vdb/openvdb_grids.h"
#include "vdb/value_steps.h"
#include "vdb/vdb_file.h"

using namespace nerfvdb;
using test::shellModel;
namespace fs = std::filesystem;

namespace {

bool sameMasks(std::span<const LeafMask> a, std::span<const LeafMask> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

/// A few cells in two shells, some of them halved once and twice.
Model smallHalvedModel() {
    Model model;
    const Shells shells = test::nestedShells(Vec3i(16, 8, 24), 2);
    const Topology cells = test::nestedTopology(shells, [](int, const Vec3i& cell) { return cell.sum() % 40 == 0; });
    model.field = VoxelField(cells, {Vec3d(1, 2, 3), 0.1}, shells, 4, 10.0);
    std::vector<std::uint8_t> halvings(2 * 2 * 1 * 3, 0);
    halvings[1] = 1, halvings[4] = 2, halvings[9] = 1;
    model.field = test::halvedField(std::move(model.field), {2, 1, 3}, halvings);
    test::setNested(model.field, [](const Vec3d&) { return 0.5; });
    model.decoder = Decoder(4, 2, 8);
    return model;
}

}  // namespace

using Catch::Matchers::Contains;

TEST_CASE("a model comes back as it was rounded, and saves to the same bytes again") {
    const TempDir folder;
    const float scale = GENERATE(1e-3f, 1.0f, 3e5f);
    Model model = shellModel(48, 8, scale);
    model.decoder = Decoder(8, 5, scale == 1 ? 64 : kDecoderWidth);  // the width travels too
    saveModel(model, folder / "a.vdb");
    const Model loaded = loadModel(folder / "a.vdb");
    saveModel(loaded, folder / "b.vdb");
    const bool same_bytes = readFile(folder / "a.vdb") == readFile(folder / "b.vdb");  // no bytes in messages
    CHECK(same_bytes);

    const Topology& before = model.field.topology();
    const Topology& after = loaded.field.topology();
    REQUIRE(after.dims() == before.dims());
    REQUIRE(after.leafCount() == before.leafCount());
    CHECK(std::equal(before.leafCoords().begin(), before.leafCoords().end(), after.leafCoords().begin()));
    CHECK(sameMasks(before.cells(), after.cells()));
    CHECK(sameMasks(before.voxels(), after.voxels()));

    CHECK(loaded.field.frame().origin == model.field.frame().origin);
    CHECK(loaded.field.frame().voxel_size == model.field.frame().voxel_size);
    CHECK(loaded.field.densityScale() == model.field.densityScale());
    CHECK(loaded.background == model.background);
    CHECK(loaded.info.schedule == model.info.schedule);
    CHECK(loaded.info.seed == model.info.seed);
    CHECK(loaded.info.train_psnr == model.info.train_psnr);
    REQUIRE(loaded.decoder.parameters().size() == model.decoder.parameters().size());
    CHECK(std::equal(model.decoder.parameters().begin(), model.decoder.parameters().end(),
                     loaded.decoder.parameters().begin()));

    // Every value is the nearest multiple of its channel's step; what is not a voxel holds nothing.
    const StepExponents steps = chooseSteps(model);
    std::size_t wrong = 0;
    for (std::size_t leaf = 0; leaf < before.leafCount(); ++leaf)
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            const bool active = testBit(before.voxels()[leaf], offset);
            for (int k = 0; k <= 8; ++k) {
                const float expected = active ? valueOf(codeOf(keptValue(model.field, voxel, k), steps[k]), steps[k])
                                              : (k == 0 ? kEmptyRaw : 0.0f);
                wrong += keptValue(loaded.field, voxel, k) != expected;
            }
        }
    CHECK(wrong == 0);
}

TEST_CASE("the cameras of a model travel with it; an older file has none") {
    const TempDir folder;
    Model model = shellModel(24);
    saveModel(model, folder / "none.vdb");
    CHECK(loadModel(folder / "none.vdb").cameras.empty());
    CHECK(readFile(folder / "none.vdb").find("nerfvdb_cameras") == std::string::npos);

    for (int i = 0; i < 3; ++i)
        model.cameras.push_back({"train/r_" + std::to_string(i) + ".png",
                                 lookAt({3, 0.1 * i, 1}, Vec3d::Zero(), Vec3d::UnitZ(), 0.7, 80, 60), i == 2});
    saveModel(model, folder / "a.vdb");
    const Model loaded = loadModel(folder / "a.vdb");
    saveModel(loaded, folder / "b.vdb");
    const bool same_bytes = readFile(folder / "a.vdb") == readFile(folder / "b.vdb");
    CHECK(same_bytes);
    REQUIRE(loaded.cameras.size() == 3);
    CHECK(loaded.cameras[1].name == "train/r_1.png");
    CHECK(loaded.cameras[1].camera.position == model.cameras[1].camera.position);
    CHECK_FALSE(loaded.cameras[1].held_out);
    CHECK(loaded.cameras[2].held_out);

    model.cameras[1].name = "/home/someone/train/r_1.png";
    CHECK_THROWS_AS(saveModel(model, folder / "a.vdb"), UsageError);
    CHECK(loadModel(folder / "a.vdb").cameras.size() == 3);
}

TEST_CASE("halved regions travel with a model, and other programs see a grid for what is halved") {
    const TempDir folder;
    Model model;
    std::vector<std::uint8_t> halvings(2 * 2 * 2 * 3, 0);
    halvings[3] = 1, halvings[7] = 2, halvings[14] = 1;
    model.field = test::halvedField(test::nestedField(Vec3i(32, 16, 24), 2, 4), {2, 2, 3}, halvings);
    test::setNested(model.field, [](const Vec3d& p) { return 0.5 * p.x() - p.y(); });
    model.decoder = Decoder(4, 2);
    saveModel(model, folder / "a.vdb");
    const Model loaded = loadModel(folder / "a.vdb");
    saveModel(loaded, folder / "b.vdb");
    const bool same_bytes = readFile(folder / "a.vdb") == readFile(folder / "b.vdb");
    CHECK(same_bytes);
    REQUIRE(loaded.field.shells().regions);
    CHECK(loaded.field.shells().regions->dims == Vec3i(2, 2, 3));
    CHECK(loaded.field.shells().regions->halvings == halvings);
    CHECK(sameMasks(model.field.topology().cells(), loaded.field.topology().cells()));

    openvdb::initialize();
    openvdb::io::File file((folder / "a.vdb").string());
    file.open(false);
    std::vector<std::string> names;
    for (auto name = file.beginName(); name != file.endName(); ++name) names.push_back(name.gridName());
    std::sort(names.begin(), names.end());
    CHECK(names == std::vector<std::string>{"density", "density_1", "density_1_half", "density_half", "density_quarter"});
    for (const auto& [name, size] : {std::pair("density", 0.1), std::pair("density_half", 0.05),
                                     std::pair("density_quarter", 0.025), std::pair("density_1_half", 0.1)}) {
        const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid(name));
        CHECK(grid->voxelSize().x() == Approx(size));
        CHECK(grid->activeVoxelCount() > 100);
        std::size_t n_close = 0;
        for (auto value = grid->cbeginValueOn(); value; ++value) {
            const openvdb::Vec3d p = grid->indexToWorld(value.getCoord());
            n_close += std::abs(*value / (10 * std::exp(0.5 * p.x() - p.y())) - 1) < 0.08;
        }
        CHECK(static_cast<double>(n_close) > 0.6 * static_cast<double>(grid->activeVoxelCount()));  // borders miss some of eight
    }
}

TEST_CASE("shells and a sky travel with a model, and other programs see a grid for each shell") {
    const TempDir folder;
    Model model;
    model.field = test::nestedField(Vec3i(16, 8, 24), 3, 4);
    test::setNested(model.field, [](const Vec3d& p) { return 0.5 * p.x() - p.y(); });
    model.decoder = Decoder(4, 2);
    model.sky = Sky(8, Vec3f(0.1f, 0.2f, 0.3f));
    model.sky.values()[5] = 1.25f;
    saveModel(model, folder / "a.vdb");
    const Model loaded = loadModel(folder / "a.vdb");
    saveModel(loaded, folder / "b.vdb");
    const bool same_bytes = readFile(folder / "a.vdb") == readFile(folder / "b.vdb");
    CHECK(same_bytes);

    CHECK(loaded.field.shells().count == 3);
    CHECK(loaded.field.shells().extent == Vec3i(16, 8, 24));
    CHECK(loaded.field.shells().stride == model.field.shells().stride);
    CHECK(sameMasks(model.field.topology().cells(), loaded.field.topology().cells()));
    for (int shell = 0; shell < 3; ++shell)
        CHECK((loaded.field.shellBox(shell).min - model.field.shellBox(shell).min).norm() == 0);
    REQUIRE(loaded.sky.width() == 8);
    CHECK(loaded.sky.values()[5] == 1.25f);
    CHECK((loaded.sky.at(Vec3f(0, 0, -1).data()) - Vec3f(0.1f, 0.2f, 0.3f)).norm() < 0.005f);

    openvdb::initialize();
    openvdb::io::File file((folder / "a.vdb").string());
    file.open(false);
    const double sigma = 10 * std::exp(0.0);
    for (int shell = 0; shell < 3; ++shell) {
        const std::string name = shell == 0 ? "density" : "density_" + std::to_string(shell);
        const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid(name));
        CHECK(grid->voxelSize().x() == Approx(0.05 * 2 * (1 << shell)));
        // Density in world units, whatever the shell: each value is what ln sigma's slope says at its place.
        std::size_t wrong = 0;
        for (auto value = grid->cbeginValueOn(); value; ++value) {
            const openvdb::Vec3d p = grid->indexToWorld(value.getCoord());
            const Box box = model.field.shellBox(shell);
            const double margin = 0.05 * (1 << shell);
            const Vec3d at(p.x(), p.y(), p.z());
            // Blocks of eight voxels that are all there, outside of the hole.
            if (!Box{box.min, box.max - Vec3d::Constant(margin)}.contains(at)) continue;
            if (shell > 0) {
                const Box hole = model.field.shellBox(shell - 1);
                if (Box{hole.min - Vec3d::Constant(margin), hole.max + Vec3d::Constant(margin)}.contains(at)) continue;
            }
            // Means of exponentials over voxels up to 0.2 apart, steps of 1/16 in raw density.
            wrong += std::abs(*value / (sigma * std::exp(0.5 * p.x() - p.y())) - 1) > 0.08;
        }
        CHECK(wrong == 0);
        CHECK(grid->activeVoxelCount() > 100);
    }
    CHECK(listGrids(folder / "a.vdb").size() == 3);
}

TEST_CASE("a model of format 2, of the time before shells, loads as one box without a sky") {
    // Made of test::shellModel(8, 4) with a decoder 8 wide and a camera by the last program that wrote the format.
    const Model loaded = loadModel(NERFVDB_SOURCE_DIR "/tests/data/format_2.vdb");
    const Model model = shellModel(8, 4);
    CHECK(loaded.field.shells().count == 1);
    CHECK(loaded.field.shells().extent == Vec3i::Constant(7));
    CHECK(loaded.sky.isEmpty());
    CHECK(loaded.background == model.background);
    CHECK(loaded.decoder.width() == 8);
    CHECK(loaded.info.schedule == model.info.schedule);
    CHECK(loaded.info.seed == model.info.seed);
    CHECK(loaded.cameras.size() == 1);
    CHECK(loaded.field.worldBox().min == model.field.worldBox().min);
    CHECK(loaded.field.worldBox().max == model.field.worldBox().max);
    REQUIRE(sameMasks(model.field.topology().cells(), loaded.field.topology().cells()));
    double worst = 0;
    for (std::size_t i = 0; i < model.field.density().size(); ++i)
        worst = std::max(worst, static_cast<double>(std::abs(model.field.density()[i] - loaded.field.density()[i])));
    CHECK(worst < 0.05);  // half a step of 1/16, and more than nothing
    CHECK(worst > 0);
}

TEST_CASE("a model of format 3 loads, and saves to the same bytes") {
    // Made of test::shellModel(8, 4) with a decoder 8 wide, a sky 4 wide and a camera.
    const fs::path path = NERFVDB_SOURCE_DIR "/tests/data/format_3.vdb";
    const Model loaded = loadModel(path);
    CHECK(loaded.sky.width() == 4);
    CHECK(loaded.decoder.width() == 8);
    REQUIRE(loaded.cameras.size() == 1);
    CHECK(loaded.cameras[0].name == "a.png");
    CHECK(sameMasks(shellModel(8, 4).field.topology().cells(), loaded.field.topology().cells()));
    const TempDir folder;
    saveModel(loaded, folder / "again.vdb");
    CHECK(readFile(folder / "again.vdb") == readFile(path));
}

TEST_CASE("a model of format 4 loads, and saves to the same bytes") {
    const fs::path path = NERFVDB_SOURCE_DIR "/tests/data/format_4.vdb";
    const Model expected = smallHalvedModel();  // what it was made of
    const Model loaded = loadModel(path);
    REQUIRE(loaded.field.shells().regions);
    CHECK(loaded.field.shells().regions->halvings == expected.field.shells().regions->halvings);
    CHECK(sameMasks(expected.field.topology().cells(), loaded.field.topology().cells()));
    const TempDir folder;
    saveModel(loaded, folder / "again.vdb");
    CHECK(readFile(folder / "again.vdb") == readFile(path));
}

TEST_CASE("the better a model, the finer its values are kept") {
    Model model = shellModel(24);
    // Standard deviation of alpha: step / sqrt(12) * exp(-1), at most two fifths of the error; 2e-3 if that is unknown.
    for (const auto& [train_psnr, exponent] : {std::pair{0.0, -6}, {25.0, -4}, {35.0, -4}, {45.0, -6}, {60.0, -7}}) {
        model.info.train_psnr = train_psnr;
        CHECK(chooseSteps(model)[0] == exponent);
    }
}

TEST_CASE("rounding changes decoded colours by less than half a level of 8 bits") {
    const TempDir folder;
    const Model model = shellModel(48, 16, 2.0f);
    saveModel(model, folder / "a.vdb");
    const Model loaded = loadModel(folder / "a.vdb");
    double sum = 0, weight_sum = 0;
    const Vec3f direction = Vec3f(1, 2, -2) / 3.0f;
    Decoder::Workspace work;
    for (std::size_t leaf = 0; leaf < model.field.topology().leafCount(); ++leaf)
        forEachBit(model.field.topology().voxels()[leaf], [&](int offset) {
            const std::size_t at = (leaf * kLeafVoxels + offset) * 16;
            float a[3], b[3];
            model.decoder.forward(1, &model.field.features()[at], direction.data(), nullptr, a, work);
            loaded.decoder.forward(1, &loaded.field.features()[at], direction.data(), nullptr, b, work);
            for (int c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]), ++weight_sum;
        });
    // The steps are chosen for a standard deviation of at most 2e-3 of one voxel; 1.5 times for one direction.
    CHECK(std::sqrt(sum / weight_sum) < 3e-3);
    CHECK(std::sqrt(sum / weight_sum) > 1e-4);  // else bytes are wasted
}

TEST_CASE("the bytes of a model do not depend on the number of threads") {
    const TempDir folder;
    const Model model = shellModel();
    saveModel(model, folder / "many.vdb");
    const ThreadLimit one(1);
    saveModel(model, folder / "one.vdb");
    const bool same_bytes = readFile(folder / "many.vdb") == readFile(folder / "one.vdb");
    CHECK(same_bytes);
}

TEST_CASE("an empty field and a full one are models too") {
    const TempDir folder;
    Model model;
    model.decoder = Decoder(4, 1);
    model.field = VoxelField(Topology(Vec3i(8, 16, 24), {}), {}, 4, 1.0);
    saveModel(model, folder / "empty.vdb");
    CHECK(loadModel(folder / "empty.vdb").field.topology().leafCount() == 0);
    CHECK(loadModel(folder / "empty.vdb").field.topology().dims() == Vec3i(8, 16, 24));

    std::vector<Topology::LeafCells> cells;
    for (int i = 0; i < 3; ++i) {
        LeafMask all;
        all.fill(~std::uint64_t{0});
        cells.push_back({Vec3i(i, 0, 0), all});
    }
    model.field = VoxelField(Topology(Vec3i(32, 16, 16), cells), {}, 4, 1.0);
    saveModel(model, folder / "full.vdb");
    const Model full = loadModel(folder / "full.vdb");
    CHECK(full.field.topology().cellCount() == 3 * 512);
    CHECK(full.field.topology().voxelCount() == 25 * 9 * 9);
}

TEST_CASE("a model without a grid, or with NaN or what no training makes, is not saved") {
    const TempDir folder;
    CHECK_THROWS_AS(saveModel(Model{}, folder / "a.vdb"), UsageError);
    for (const float bad : {NAN, INFINITY, -INFINITY}) {
        Model model = shellModel();
        const auto voxels = model.field.topology().voxels();
        std::size_t leaf = voxels.size() / 2;
        while (voxels[leaf] == LeafMask{}) ++leaf;
        std::size_t voxel = 0;
        forEachBit(voxels[leaf], [&](int offset) { voxel = leaf * kLeafVoxels + offset; });
        model.field.density()[voxel] = bad;
        CHECK_THROWS_AS(saveModel(model, folder / "a.vdb"), NumericError);
        model.field.density()[voxel] = 0;
        model.field.features()[voxel * 8 + 5] = bad;
        CHECK_THROWS_WITH(saveModel(model, folder / "a.vdb"), Contains("feature channel 5"));
        model.field.features()[voxel * 8 + 5] = -2e6f;
        CHECK_THROWS_WITH(saveModel(model, folder / "a.vdb"), Contains("feature channel 5"));
        model.field.features()[voxel * 8 + 5] = 0;
        for (const float weight : {bad, 2e6f}) {
            model.decoder.parameters()[3] = weight;
            CHECK_THROWS_AS(saveModel(model, folder / "a.vdb"), NumericError);
        }
    }
    CHECK_FALSE(fs::exists(folder / "a.vdb"));
}

TEST_CASE("other programs see the density in world units") {
    const TempDir folder;
    Model model = shellModel();
    saveModel(model, folder / "a.vdb");
    openvdb::initialize();
    openvdb::io::File file((folder / "a.vdb").string());
    file.open(false);
    const auto grids = file.getGrids();
    REQUIRE(grids->size() == 1);
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(grids->front());
    CHECK(grid->getName() == "density");
    CHECK(grid->getGridClass() == openvdb::GRID_FOG_VOLUME);
    CHECK(grid->saveFloatAsHalf());
    CHECK(grid->background() == 0.0f);
    // Each voxel is the mean of eight of the model's; those that it has not are empty.
    const double voxel_size = 2.4 / 48;
    const VoxelField& field = loadModel(folder / "a.vdb").field;
    const Vec3i dims = field.topology().dims();
    const auto sigma = [&](const Vec3i& ijk, bool& exists) {
        const std::int32_t leaf = field.topology().findLeaf(ijk / kLeafDim);
        const int offset = brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
        if (leaf < 0 || !testBit(field.topology().voxels()[leaf], offset)) return 0.0f;
        exists = true;
        return volumeSigma(field.density()[leaf * kLeafVoxels + offset], 40.0, voxel_size);
    };
    const auto accessor = grid->getConstAccessor();
    std::size_t wrong = 0, active = 0;
    for (int x = 0; x < dims.x(); x += 2)
        for (int y = 0; y < dims.y(); y += 2)
            for (int z = 0; z < dims.z(); z += 2) {
                bool exists = false;
                float mean = 0;
                for (int i = 0; i < 8; ++i) mean += sigma({x + (i >> 2), y + (i >> 1 & 1), z + (i & 1)}, exists) / 8;
                mean = std::min(mean, static_cast<float>(16 / (2 * voxel_size)));
                const openvdb::Coord at(x / 2, y / 2, z / 2);
                active += exists;
                wrong += accessor.isValueOn(at) != exists ||
                         std::abs(accessor.getValue(at) - mean) > mean * 0x1.01p-11f;  // half keeps 11 bits
            }
    CHECK(wrong == 0);
    CHECK(grid->activeVoxelCount() == active);
    const openvdb::Vec3d world = grid->indexToWorld(openvdb::Vec3d(3, 4, 5));
    const Vec3d expected = field.frame().worldFromIndex(Vec3d(6.5, 8.5, 10.5));
    for (int axis = 0; axis < 3; ++axis) CHECK(world[axis] == Approx(expected[axis]).epsilon(1e-14));
}

TEST_CASE("densities that half cannot say are stored as float") {
    const TempDir folder;
    for (const double voxel_size : {2e-5, 1e4}) {  // sigma of 50,000 and more overflows half; far below 1e-3 it loses its bits
        Model model;
        model.field = VoxelField(test::shellTopology(24), {Vec3d::Zero(), voxel_size}, 8, 2.0 / voxel_size);
        for (float& raw : model.field.density()) raw = 0.0f;
        model.decoder = Decoder(8, 1);
        saveModel(model, folder / "a.vdb");
        openvdb::initialize();
        openvdb::io::File file((folder / "a.vdb").string());
        file.open(false);
        const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("density"));
        CHECK_FALSE(grid->saveFloatAsHalf());
        float largest = 0;
        for (auto value = grid->cbeginValueOn(); value; ++value) largest = std::max(largest, *value);
        CHECK(largest == static_cast<float>(2.0 / voxel_size));  // far from opaque: as it is
    }
}

TEST_CASE("a save that fails leaves the old file alone") {
    const TempDir folder;
    const Model model = shellModel(24);
    const fs::path path = folder / "model.vdb";
    saveModel(model, path);
    const std::string old = readFile(path);

    // A disk that is full after some kilobytes, in a process of its own.
    for (const std::size_t limit : {std::size_t{0}, old.size() / 4, old.size() - 1}) {
        const pid_t child = fork();
        REQUIRE(child >= 0);
        if (child == 0) {
            const ThreadLimit one(1);  // the parent's threads did not come along
            std::signal(SIGXFSZ, SIG_IGN);
            const rlimit full{limit, limit};
            setrlimit(RLIMIT_FSIZE, &full);
            try {
                saveModel(model, path);
            } catch (const IoError& error) {
                _exit(std::string(error.what()).find("model.vdb") != std::string::npos ? 0 : 3);
            } catch (...) {
                _exit(2);
            }
            _exit(1);
        }
        int status = 0;
        waitpid(child, &status, 0);
        CHECK(WIFEXITED(status));
        CHECK(WEXITSTATUS(status) == 0);
        const bool untouched = readFile(path) == old;
        CHECK(untouched);
    }
    CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 1);

    fs::create_directory(folder / "folder.vdb");
    CHECK_THROWS_AS(saveModel(model, folder / "folder.vdb"), IoError);
    CHECK_THROWS_AS(saveModel(model, folder / "absent" / "model.vdb"), IoError);
    if (geteuid() != 0) {  // root may write anywhere
        fs::create_directory(folder / "closed");
        fs::permissions(folder / "closed", fs::perms::owner_read | fs::perms::owner_exec);
        CHECK_THROWS_AS(saveModel(model, folder / "closed" / "model.vdb"), IoError);
        fs::permissions(folder / "closed", fs::perms::owner_all);
    }
}

TEST_CASE("vdb_print opens a model") {
    NERFVDB_NEEDS("/usr/bin/vdb_print");
    const TempDir folder;
    saveModel(shellModel(24), folder / "model.vdb");
    const std::string out = (folder / "out.txt").string();
    CHECK(std::system(("/usr/bin/vdb_print -l -m " + (folder / "model.vdb").string() + " > " + out + " 2>&1").c_str()) == 0);
    const std::string text = readFile(out);
    CHECK_THAT(text, Contains("density") && Contains("float") && Contains("nerfvdb_schedule: 120,300,900"));
    CHECK_THAT(text, Contains("nerfvdb_values: <binary data>"));
}

TEST_CASE("OpenVDB's Python module opens a model") {
    if (std::system("/usr/bin/python3 -c 'import pyopenvdb' > /dev/null 2>&1") != 0) {
        std::cout << "skipped: no pyopenvdb here" << std::endl;
        ++testing::skippedTests();
        return;
    }
    const TempDir folder;
    const Model model = shellModel(24);
    saveModel(model, folder / "model.vdb");
    const std::string script = "import pyopenvdb as vdb\ngrids, facts = vdb.readAll('" + (folder / "model.vdb").string() +
                               "')\nassert [g.name for g in grids] == ['density']\n"
                               "assert grids[0].activeVoxelCount() == " +
                               std::to_string(listGrids(folder / "model.vdb").front().active_voxels) +
                               "\nassert facts['nerfvdb_format'] == 3\nassert facts['nerfvdb_schedule'] == '120,300,900'\n";
    writeAtomically(folder / "check.py", script);
    CHECK(std::system(("/usr/bin/python3 " + (folder / "check.py").string()).c_str()) == 0);
}
