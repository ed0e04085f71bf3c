// SPDX-License-Identifier: Apache-2.0
// The whole story on the smallest scene: photographs in, a model that shows held-out views, a file that repeats
// it, a volume and a mesh out.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "core/parallel.h"
#include "export/marching_cubes.h"
#include "export/mesh_cleanup.h"
#include "export/vdb_export.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/temp_dir.h"
#include "trainer/evaluate.h"
#include "trainer/trainer.h"
#include "vdb/model_file.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_file.h"

using namespace nerfvdb;

namespace {

constexpr double kRadius = 0.8;      // of the ball that `synth sphere` shows
constexpr double kLeastPsnr = 34.5;  // dB; measured 35.5, less one for other instruction sets and small changes

Model trained(int threads) {
    static const Dataset dataset = test::surroundedSphereDataset(24, 100);
    const ThreadLimit limit(threads);
    TrainOptions options;
    options.steps = {1500};
    Report silent;
    return train(dataset, options, silent, {}).model;
}

double heldOutPsnr(const Model& model) {
    static const Dataset dataset = test::sphereDataset(Split::test, 4, 100);
    Report silent;
    return evaluate(model, dataset, {}, silent).psnr;
}

/// The exported density, reopened, is the model's own, at every voxel that the file keeps.
void checkVolume(const Model& model, const std::filesystem::path& path) {
    Report silent;
    const ExportVdbReport report = exportVdb(model, path, {}, silent);
    openvdb::initialize();
    openvdb::io::File file(path.string());
    file.open();
    const auto density = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("density"));
    REQUIRE(density);
    CHECK(density->activeVoxelCount() == report.active_voxels);
    CHECK(report.active_voxels > 1000);
    const VoxelField& field = model.field;
    int wrong = 0;
    for (auto value = density->cbeginValueOn(); value; ++value) {
        const openvdb::Vec3d at = density->indexToWorld(value.getCoord());
        const Vec3d index = field.frame().indexFromWorld({at.x(), at.y(), at.z()});
        const Vec3i ijk = index.array().round().cast<int>();
        const int leaf = field.topology().findLeaf({ijk.x() >> 3, ijk.y() >> 3, ijk.z() >> 3});
        if (leaf < 0 || (index - ijk.cast<double>()).norm() > 1e-6) {
            ++wrong;
            continue;
        }
        const std::size_t voxel =
            static_cast<std::size_t>(leaf) * kLeafVoxels + brickOffset(ijk.x() & 7, ijk.y() & 7, ijk.z() & 7);
        const float expected =
            volumeSigma(field.density()[voxel], field.densityScale(), field.frame().voxel_size);
        wrong += !(std::abs(*value - expected) <= expected / 2048);  // half precision
    }
    CHECK(wrong == 0);
}

/// The mesh is one closed ball, its radius right within a voxel (at 99 vertices of a hundred).
void checkMesh(const Model& model) {
    const double voxel = model.field.frame().voxel_size;
    MeshOptions options;
    options.fill_inside = true;
    // Half of the light stopped over six voxels, not one: after so few steps the ball's skin has pinholes that
    // lead into the froth inside, which no camera sees. They close below 0.25 to 0.35 of the automatic level,
    // measured with three seeds.
    options.iso = automaticIso(model.field) / 6;
    Report silent;
    Mesh mesh = extractSurface(model, options, silent);
    removeIslands(mesh, {/*keep_largest=*/1, /*min_faces=*/0});  // a crumb or two float outside
    const MeshMeasures measures = measureMesh(mesh);
    CHECK(measures.closed());
    CHECK(measures.degenerate_faces == 0);
    CHECK(measures.euler == 2);

    std::vector<double> error;  // of each vertex's radius, voxels
    double mean = 0;
    for (const Vec3f& position : mesh.positions) {
        const double radius = position.cast<double>().norm();
        error.push_back(std::abs(radius - kRadius) / voxel);
        mean += radius / static_cast<double>(mesh.positions.size());
    }
    std::sort(error.begin(), error.end());
    // Measured with three seeds: mean 0.813, 99 % below 0.89 voxels, the worst vertex 1.2.
    CHECK(std::abs(mean - kRadius) < 0.6 * voxel);
    CHECK(error[error.size() * 99 / 100] < 1);
    CHECK(error.back() < 1.5);
}

}  // namespace

TEST_CASE("the sphere's whole story: learn, show, save, load, export, mesh; the same on 1 and 2 threads") {
    const TempDir dir;
    const Model model = trained(2);
    const double psnr = heldOutPsnr(model);
    CHECK(psnr > kLeastPsnr);

    saveModel(model, dir / "model.vdb");
    const Model loaded = loadModel(dir / "model.vdb");
    CHECK(std::abs(heldOutPsnr(loaded) - psnr) < 0.02);  // the allowance for what saving rounds
    saveModel(loaded, dir / "again.vdb");
    const std::string bytes = readFile(dir / "model.vdb");
    CHECK(readFile(dir / "again.vdb") == bytes);

    checkVolume(loaded, dir / "volume.vdb");
    checkMesh(loaded);

    saveModel(trained(1), dir / "one_thread.vdb");
    CHECK(readFile(dir / "one_thread.vdb") == bytes);
}
