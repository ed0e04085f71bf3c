// SPDX-License-Identifier: Apache-2.0
// The whole story on the smallest scene: photographs in, a model that shows held-out views, a file that repeats
// it, a volume and a mesh out.
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <numbers>
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
#include "vdb/vdb_file.h"

using namespace nerfvdb;

namespace {

constexpr double kRadius = 0.8;      // of the ball that `synth sphere` shows
constexpr double kLeastPsnr = 32.0;  // dB; measured 33.0, less one for other instruction sets and small changes

Model trained(int threads) {
    static const Dataset dataset = test::sphereDataset(Split::train, 24, 100);
    const ThreadLimit limit(threads);
    TrainOptions options;
    options.steps = {600};
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
    const ExportVdbReport report = exportVdb(model, path);
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

/// The mesh is closed, and its outside lies within a voxel of the ball wherever cameras look. (Nobody sees the
/// ball from below, nor its inside, where training leaves holes.)
void checkMesh(const Model& model) {
    Report silent;
    Mesh mesh = extractSurface(model, {}, silent);
    removeIslands(mesh, {/*keep_largest=*/1, /*min_faces=*/0});
    const MeshMeasures measures = measureMesh(mesh);
    CHECK(measures.closed());
    CHECK(measures.degenerate_faces == 0);

    // The outermost vertex in each of many patches of equal area on the upper half.
    constexpr int kRings = 12, kSectors = 36;
    std::vector<double> outermost(kRings * kSectors, 0.0);
    for (const Vec3f& position : mesh.positions) {
        const Vec3d p = position.cast<double>();
        if (p.z() < 0) continue;
        const int ring = std::min(kRings - 1, static_cast<int>(kRings * p.z() / p.norm()));
        const double turn = std::atan2(p.y(), p.x()) / (2 * std::numbers::pi) + 0.5;
        double& radius = outermost[ring * kSectors + std::min(kSectors - 1, static_cast<int>(kSectors * turn))];
        radius = std::max(radius, p.norm());
    }
    const double voxel = model.field.frame().voxel_size;
    const auto n_low = std::count_if(outermost.begin(), outermost.end(),
                                     [&](double radius) { return radius < kRadius - voxel; });
    // Measured 1 of 432: so few steps leave a dark spot softer than the iso level. Two in a hundred are
    // allowed.
    CHECK(n_low <= kRings * kSectors / 50);
    CHECK(*std::max_element(outermost.begin(), outermost.end()) < kRadius + voxel);
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
