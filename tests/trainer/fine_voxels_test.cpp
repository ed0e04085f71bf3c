// SPDX-License-Identifier: Apache-2.0
// Voxels smaller than are chosen by themselves: `--voxel-size`.
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/temp_dir.h"
#include "trainer/trainer.h"

using namespace nerfvdb;

namespace {

/// Voxels of a thin beam through the ball that are left when it has so many along it.
double voxelsAlong(int resolution, std::vector<std::int64_t> steps) {
    TrainOptions options;
    options.bounds = Box{{-0.9, -0.02, -0.02}, {0.9, 0.02, 0.02}};
    options.voxel_size = 1.8 / resolution;
    options.steps = std::move(steps);
    const Dataset dataset = test::surroundedSphereDataset(24, 64);
    Report silent;
    const TempDir dir;
    const TrainResult result = train(dataset, options, silent, {}, dir / "ball.ckpt", false);
    REQUIRE(result.model.field.frame().voxel_size == *options.voxel_size);
    return static_cast<double>(result.model.field.topology().voxelCount());
}

}  // namespace

TEST_CASE("where the size of a voxel halves, voxels grow in number as a surface does, not as a volume") {
    // So few steps learn no surface but a haze; undivided it would be eight times as many voxels.
    const double coarse = voxelsAlong(512, {20, 10, 10, 10, 10}), fine = voxelsAlong(1024, {20, 10, 10, 10, 10, 10});
    CAPTURE(coarse, fine);
    CHECK(fine / coarse > 1);
    CHECK(fine / coarse < 4.5);
}
