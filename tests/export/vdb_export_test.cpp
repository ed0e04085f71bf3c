// SPDX-License-Identifier: Apache-2.0
#include "export/vdb_export.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/image.h"
#include "core/metrics.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "tests/support/grid_field.h"
#include "tests/support/seen_model.h"
#include "tests/support/temp_dir.h"
#include "vdb/model_file.h"
#include "vdb/openvdb_grids.h"
#include "vdb/volume_file.h"
#include "vdb/volume_renderer.h"

using namespace nerfvdb;
using test::shellModel;
namespace fs = std::filesystem;

namespace {

openvdb::GridPtrVec readGrids(const fs::path& path) {
    openvdb::initialize();
    openvdb::io::File file(path.string());
    file.open(false);
    return *file.getGrids();
}

/// The grid of a name and type; never null.
template <typename Grid>
typename Grid::Ptr gridNamed(const fs::path& path, const std::string& name) {
    for (const openvdb::GridBase::Ptr& grid : readGrids(path))
        if (auto found = openvdb::gridPtrCast<Grid>(grid); found && grid->getName() == name) return found;
    throw std::runtime_error("no grid " + name);
}

/// Shell densities from almost nothing to opaque.
Model fadingModel() {
    Model model = shellModel(32);
    for (float& raw : model.field.density()) raw = 2 * raw - 6;  // of [-1, 5]: sigma from 0.013 to 2200
    return model;
}

bool imports(const std::string& python) {
    return std::system(("/usr/bin/python3 -c 'import " + python + "' > /dev/null 2>&1").c_str()) == 0;
}

Report silent;

}  // namespace

using Catch::Matchers::Contains;

TEST_CASE("an exported volume holds density per world unit and linear colour") {
    const TempDir folder;
    const Model model = fadingModel();
    ExportVdbOptions options;
    options.half = false;
    options.min_alpha = 0.01;
    const ExportVdbReport report = exportVdb(model, folder / "volume.vdb", options, silent);
    CHECK(readGrids(folder / "volume.vdb").size() == 2);
    const auto density = gridNamed<openvdb::FloatGrid>(folder / "volume.vdb", "density");
    const auto color = gridNamed<openvdb::Vec3SGrid>(folder / "volume.vdb", "color");
    CHECK(density->getGridClass() == openvdb::GRID_FOG_VOLUME);
    CHECK(density->background() == 0.0f);
    CHECK(color->background() == openvdb::Vec3s(0.0f));
    CHECK(density->transform() == color->transform());
    CHECK_FALSE(density->saveFloatAsHalf());

    // Voxel by voxel: all that is visible and nothing else, exactly.
    const VoxelField& field = model.field;
    const auto sigma_at = density->getConstAccessor();
    const auto color_at = color->getConstAccessor();
    std::size_t visible = 0, wrong_density = 0, n_capped = 0, wrong_color = 0, without_color = 0;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        forEachBit(field.topology().voxels()[leaf], [&](int offset) {
            const std::size_t voxel = leaf * kLeafVoxels + offset;
            const Vec3i ijk = test::voxelOf(field.topology(), leaf, offset);
            const openvdb::Coord at(ijk.x(), ijk.y(), ijk.z());
            const float sigma = sigmaFromRaw(field.density()[voxel], field.densityScale());
            const bool is_visible = 1 - std::exp(-static_cast<double>(sigma) * field.frame().voxel_size) >= 0.01;
            visible += is_visible;
            // no denser than an optical depth of 16 over a voxel
            const float capped = std::min(sigma, static_cast<float>(16 / field.frame().voxel_size));
            n_capped += is_visible && capped < sigma;
            wrong_density += sigma_at.isValueOn(at) != is_visible || sigma_at.getValue(at) != (is_visible ? capped : 0);
            without_color += is_visible && !color_at.isValueOn(at);
            if (!color_at.isValueOn(at)) return;
            float srgb[3];
            model.decoder.diffuse(1, &field.features()[voxel * 8], srgb);
            for (int c = 0; c < 3; ++c)
                // batches of another size may round differently in the last bits
                wrong_color += std::abs(color_at.getValue(at)[c] - linearFromSrgb(srgb[c])) > 1e-5f;
        });
    CHECK(visible > 1000);
    CHECK(wrong_density == 0);
    CHECK(n_capped > 100);
    CHECK(wrong_color == 0);
    CHECK(without_color == 0);
    CHECK(density->activeVoxelCount() == visible);
    CHECK(color->activeVoxelCount() > visible);  // one voxel beyond

    CHECK(report.active_voxels == visible);
    CHECK(report.left_out == field.topology().voxelCount() - visible);
    CHECK(report.left_out > 100);
    CHECK(report.bytes == fs::file_size(folder / "volume.vdb"));
    CHECK_FALSE(report.loss.has_value());  // the model names no cameras
    CHECK_FALSE(report.has_view_colors);
    const openvdb::CoordBBox box = density->evalActiveVoxelBoundingBox();
    for (int axis = 0; axis < 3; ++axis) {
        CHECK(report.bounds.min[axis] == Approx(density->indexToWorld(box.min())[axis]));
        CHECK(report.bounds.max[axis] == Approx(density->indexToWorld(box.max())[axis]));
    }
}

TEST_CASE("half precision and no colour make smaller files") {
    const TempDir folder;
    const Model model = fadingModel();
    ExportVdbOptions options;
    const ExportVdbReport small = exportVdb(model, folder / "half.vdb", options, silent);
    options.half = false;
    const ExportVdbReport full = exportVdb(model, folder / "full.vdb", options, silent);
    options.color = ExportVdbOptions::Color::none;
    const ExportVdbReport grey = exportVdb(model, folder / "grey.vdb", options, silent);
    CHECK(small.half);
    CHECK_FALSE(full.half);
    CHECK(small.bytes < 0.7 * full.bytes);
    CHECK(grey.bytes < 0.5 * full.bytes);
    CHECK(readGrids(folder / "grey.vdb").size() == 1);

    const auto rounded = gridNamed<openvdb::FloatGrid>(folder / "half.vdb", "density");
    const auto exact = gridNamed<openvdb::FloatGrid>(folder / "full.vdb", "density");
    CHECK(rounded->saveFloatAsHalf());
    for (auto value = exact->cbeginValueOn(); value; ++value)
        REQUIRE(rounded->tree().getValue(value.getCoord()) == Approx(*value).epsilon(0x1p-11));
}

TEST_CASE("exports repeat byte for byte, for any number of threads") {
    const TempDir folder;
    const Model model = fadingModel();
    exportVdb(model, folder / "a.vdb", {}, silent);
    exportVdb(model, folder / "b.vdb", {}, silent);
    const ThreadLimit one(1);
    exportVdb(model, folder / "c.vdb", {}, silent);
    const bool same = readFile(folder / "a.vdb") == readFile(folder / "b.vdb") &&
                      readFile(folder / "a.vdb") == readFile(folder / "c.vdb");
    CHECK(same);
}

TEST_CASE("a model with nothing visible is refused, and nothing is written") {
    const TempDir folder;
    Model model = shellModel(24);
    for (float& raw : model.field.density()) raw = kEmptyRaw;
    CHECK_THROWS_WITH(exportVdb(model, folder / "a.vdb", {}, silent), Contains("a model without density"));
    CHECK(fs::is_empty(folder.path()));
}

TEST_CASE("a model that names its cameras is exported as they saw it, fitted and measured") {
    const TempDir folder;
    const Model model = test::seenModel(32);
    ExportVdbOptions options;
    options.fit_steps = 0;
    const ExportVdbReport rough = exportVdb(model, folder / "rough.vdb", options, silent);
    options.fit_steps = 100;
    const ExportVdbReport fitted = exportVdb(model, folder / "fitted.vdb", options, silent);
    options.color = ExportVdbOptions::Color::mean;
    const ExportVdbReport mean = exportVdb(model, folder / "mean.vdb", options, silent);
    for (const ExportVdbReport* report : {&rough, &fitted, &mean}) {
        REQUIRE(report->loss.has_value());
        CHECK(report->loss->views == 2);  // the held-out ones
    }
    CHECK(fitted.has_view_colors);
    CHECK_FALSE(mean.has_view_colors);
    CHECK(fitted.loss->psnr > rough.loss->psnr + 2);
    CHECK(fitted.loss->psnr > mean.loss->psnr + 1);

    // What the report says of the volume is what the file shows.
    const VolumeFile file = readVolume(folder / "fitted.vdb");
    std::vector<Camera> held_out{model.cameras[6].camera, model.cameras[7].camera};
    CHECK(measureLoss(model, file.volume, held_out, silent).psnr == Approx(fitted.loss->psnr).margin(0.1));  // half
    CHECK(file.background == model.background);

    const ThreadLimit one(1);
    options.color = ExportVdbOptions::Color::diffuse;
    exportVdb(model, folder / "again.vdb", options, silent);
    CHECK(readFile(folder / "again.vdb") == readFile(folder / "fitted.vdb"));
}

TEST_CASE("limits are kept, by coarser voxels") {
    const TempDir folder;
    const Model model = test::seenModel(48);
    ExportVdbOptions options;
    options.fit_steps = 0;
    const ExportVdbReport whole = exportVdb(model, folder / "whole.vdb", options, silent);
    options.max_resolution = 20;
    const ExportVdbReport coarse = exportVdb(model, folder / "coarse.vdb", options, silent);
    CHECK(coarse.box_voxels.maxCoeff() <= 20);
    CHECK(coarse.box_voxels.maxCoeff() >= 18);
    CHECK(coarse.voxel_size > whole.voxel_size * 1.5);
    options.max_resolution = 0;
    options.max_voxels = 2000;
    const ExportVdbReport few = exportVdb(model, folder / "few.vdb", options, silent);
    CHECK(few.active_voxels <= 2000);
    CHECK(few.active_voxels > 1300);  // of which the cameras do not see all
    options.max_voxels = 0;
    options.max_blender_bytes = 1e6;
    const ExportVdbReport small = exportVdb(model, folder / "small.vdb", options, silent);
    CHECK(small.blender_bytes <= 1e6);
    CHECK(small.blender_bytes > 0.4e6);
    options.max_blender_bytes = 0;
    options.max_voxels = 1;
    CHECK_THROWS_AS(exportVdb(model, folder / "none.vdb", options, silent), Error);  // one voxel is no scene
    CHECK_FALSE(fs::exists(folder / "none.vdb"));
}

TEST_CASE("where own voxels lose too much, finer ones are taken, unless told otherwise") {
    const TempDir folder;
    Model model = test::seenModel(24);
    // Rods thinner than a voxel: one voxel in four is dense, along one axis.
    test::forEachVoxel(model.field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        model.field.density()[i] = ijk.x() % 4 == 0 && ijk.y() % 4 == 0 ? 6.0f : -12.0f;
    });
    ExportVdbOptions options;
    options.fit_steps = 60;
    const ExportVdbReport chosen = exportVdb(model, folder / "chosen.vdb", options, silent);
    CHECK(chosen.finer > 1);
    options.finer = 1;
    const ExportVdbReport own = exportVdb(model, folder / "own.vdb", options, silent);
    CHECK(own.finer == 1);
    CHECK(own.loss->psnr < own.loss->psnr_diffuse - 1);
    CHECK(chosen.loss->psnr > own.loss->psnr + 1);
    options.finer.reset();
    options.max_resolution = 1000;
    CHECK(exportVdb(model, folder / "limited.vdb", options, silent).finer == 1);
    options.finer = 5;
    CHECK_THROWS_AS(exportVdb(model, folder / "bad.vdb", options, silent), UsageError);
}

TEST_CASE("tiles line up: together they are the whole volume, voxel by voxel") {
    const TempDir folder;
    const Model model = test::seenModel(48);
    ExportVdbOptions options;
    options.fit_steps = 0;
    options.half = false;
    exportVdb(model, folder / "whole.vdb", options, silent);
    options.tiles = 3;
    const ExportVdbReport report = exportVdb(model, folder / "part.vdb", options, silent);
    CHECK(exportPaths(folder / "part.vdb", 3) ==
          std::vector<fs::path>{folder / "part.000.vdb", folder / "part.001.vdb", folder / "part.002.vdb"});
    const auto whole = gridNamed<openvdb::FloatGrid>(folder / "whole.vdb", "density");
    const auto whole_color = gridNamed<openvdb::Vec3SGrid>(folder / "whole.vdb", "color");
    std::size_t n = 0, wrong = 0;
    REQUIRE(report.files.size() == 3);
    for (const ExportVdbReport::File& file : report.files) {
        const auto part = gridNamed<openvdb::FloatGrid>(file.path, "density");
        const auto color = gridNamed<openvdb::Vec3SGrid>(file.path, "color");
        wrong += !(part->transform() == whole->transform());
        CHECK(part->activeVoxelCount() == file.active_voxels);
        CHECK(file.active_voxels > 0.15 * static_cast<double>(whole->activeVoxelCount()));
        for (auto value = part->cbeginValueOn(); value; ++value, ++n)
            wrong += *value != whole->tree().getValue(value.getCoord());
        for (auto value = color->cbeginValueOn(); value; ++value)
            wrong += *value != whole_color->tree().getValue(value.getCoord());
    }
    CHECK(wrong == 0);
    CHECK(n == whole->activeVoxelCount());  // each once
}

TEST_CASE("bounds, scale, up and origin: the file stands where the report says") {
    const TempDir folder;
    const Model model = test::seenModel(48);
    const Box whole = model.field.worldBox();
    ExportVdbOptions options;
    options.fit_steps = 0;
    options.bounds = Box{whole.min, {whole.max.x(), whole.max.y(), whole.center().z()}};
    options.placement = {.scale = 10, .source_up = UpAxis::z, .up = UpAxis::y, .origin = PlacementOptions::Origin::ground};
    const ExportVdbReport report = exportVdb(model, folder / "a.vdb", options, silent);
    CHECK(report.bounds.max.z() <= whole.center().z());
    CHECK(report.voxel_size == Approx(10 * model.field.frame().voxel_size));
    const auto density = gridNamed<openvdb::FloatGrid>(folder / "a.vdb", "density");
    double lowest = 1e9;
    Vec3d sum = Vec3d::Zero();
    for (auto value = density->cbeginValueOn(); value; ++value) {
        const Vec3d at(density->indexToWorld(value.getCoord()).asPointer());
        lowest = std::min(lowest, at.y());
        sum += at;
    }
    CHECK(lowest == Approx(0).margin(0.6 * report.voxel_size));
    const Vec3d mean = sum / static_cast<double>(density->activeVoxelCount());
    CHECK(std::abs(mean.x()) < 1);  // of a size of 24
    CHECK(std::abs(mean.z()) < 1);
    CHECK(mean.y() > 2);

    // Seen from a camera that was moved with it, it is the same picture as from the old place without.
    ExportVdbOptions still = options;
    still.placement = {};
    exportVdb(model, folder / "b.vdb", still, silent);
    const VolumeFile moved = readVolume(folder / "a.vdb"), left = readVolume(folder / "b.vdb");
    const Camera camera = model.cameras[0].camera;
    const RenderedImage there = VolumeRenderer(moved.volume, {}).render(report.placement.apply(camera));
    const RenderedImage here = VolumeRenderer(left.volume, {}).render(camera);
    CHECK(psnr(there.rgb, here.rgb) > 50);  // half precision of other numbers
    options.bounds = Box{whole.max + Vec3d::Ones(), whole.max + Vec3d::Constant(2)};
    CHECK_THROWS_WITH(exportVdb(model, folder / "c.vdb", options, silent), Contains("a box without any of the scene"));
}

TEST_CASE("exports that cannot be are refused") {
    const TempDir folder;
    const Model model = shellModel(24);
    for (const double bad : {-0.1, 1.0, static_cast<double>(NAN)}) {
        ExportVdbOptions options;
        options.min_alpha = bad;
        CHECK_THROWS_AS(exportVdb(model, folder / "a.vdb", options, silent), UsageError);
    }
    CHECK_THROWS_AS(exportVdb(model, folder.path(), {}, silent), IoError);
    CHECK_THROWS_AS(exportVdb(model, folder / "absent" / "a.vdb", {}, silent), IoError);
    CHECK(fs::is_empty(folder.path()));
    exportVdb(model, folder / "a.vdb", {}, silent);
    CHECK_THROWS_WITH(loadModel(folder / "a.vdb"), Contains("exported volume"));
}

TEST_CASE("vdb_print opens an exported volume") {
    NERFVDB_NEEDS("/usr/bin/vdb_print");
    const TempDir folder;
    exportVdb(fadingModel(), folder / "volume.vdb", {}, silent);
    const std::string out = (folder / "out.txt").string();
    CHECK(std::system(("/usr/bin/vdb_print -l -m " + (folder / "volume.vdb").string() + " > " + out + " 2>&1").c_str()) == 0);
    CHECK_THAT(readFile(out), Contains("density") && Contains("color") && Contains("vec3s") && Contains("fog volume"));
}

TEST_CASE("OpenVDB's Python module opens an exported volume") {
    if (!imports("pyopenvdb")) {
        std::cout << "skipped: no pyopenvdb here" << std::endl;
        ++testing::skippedTests();
        return;
    }
    const TempDir folder;
    const ExportVdbReport report = exportVdb(fadingModel(), folder / "volume.vdb", {}, silent);
    std::ofstream(folder / "check.py")
        << "import pyopenvdb as vdb\ngrids, facts = vdb.readAll('" << (folder / "volume.vdb").string() << "')\n"
        << "named = {g.name: g for g in grids}\n"
        << "assert sorted(named) == ['color', 'density'], named\n"
        << "assert named['density'].activeVoxelCount() == " << report.active_voxels << "\n"
        << "assert named['density'].gridClass == 'fog volume' and named['density'].saveFloatAsHalf\n"
        << "assert facts['color_space'] == 'linear Rec. 709', facts\n";
    CHECK(std::system(("/usr/bin/python3 " + (folder / "check.py").string()).c_str()) == 0);
}

TEST_CASE("Blender opens models and exported volumes") {
    if (std::system("command -v blender > /dev/null 2>&1") != 0) {
        std::cout << "skipped: no blender here" << std::endl;
        ++testing::skippedTests();
        return;
    }
    const TempDir folder;
    const Model model = fadingModel();
    saveModel(model, folder / "model.vdb");
    exportVdb(model, folder / "volume.vdb", {}, silent);
    const std::string command =
        "blender --background --factory-startup --python-exit-code 1 --python " NERFVDB_SOURCE_DIR
        "/tests/export/open_in_blender.py -- " +
        (folder / "model.vdb").string() + " density:FLOAT " + (folder / "volume.vdb").string() +
        " color:VECTOR_FLOAT,density:FLOAT > " + (folder / "log.txt").string() + " 2>&1";
    const int status = std::system(command.c_str());
    INFO(readFile(folder / "log.txt"));
    CHECK(status == 0);
}
