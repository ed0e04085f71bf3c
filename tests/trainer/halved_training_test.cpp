// SPDX-License-Identifier: Apache-2.0
// A training that halves voxels where photographs resolve more (resolved_regions.h), from its steps to its file.
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/stopped_training.h"
#include "tests/support/temp_dir.h"
#include "trainer/trainer.h"

using namespace nerfvdb;
using test::modelBytes;
using test::StopAfter;

namespace {

/// A wall with a pattern, through long lenses: pixels a ninth as wide as 1/512 of the box.
Dataset closeUps() {
    constexpr int kSize = 240;
    constexpr double kTile = 0.03, kSpeck = 0.002;  // world units
    const auto squareOf = [](const Vec3d& p, double size) {
        return std::pair{std::llround(p.x() / size), std::llround(p.y() / size)};
    };
    Dataset dataset;
    dataset.root = "close-ups";
    for (int v = 0; v < 9; ++v) {
        View view;
        view.camera = lookAt(Vec3d(0.5 * (v % 3 - 1), 0.5 * (v / 3 - 1), 4), Vec3d::Zero(), Vec3d::UnitY(), 0.05, kSize, kSize);
        view.path = "view " + std::to_string(v);
        view.photo.width = view.photo.height = kSize;
        view.photo.pixels.resize(kSize * kSize);
        for (int i = 0; i < kSize * kSize; ++i) {
            const Ray ray = cameraRay(view.camera, i % kSize + 0.5, i / kSize + 0.5);
            const Vec3d p = ray.origin - ray.origin.z() / ray.direction.z() * ray.direction;
            const auto [a, b] = squareOf(p, kTile);
            const auto [c, d] = squareOf(p, kSpeck);
            const std::uint64_t speck = randomBits(5, static_cast<std::uint64_t>(c), static_cast<std::uint64_t>(d));
            const auto grey = static_cast<std::uint8_t>(((a + b) & 1 ? 40 : 160) + speck % 64);
            view.photo.pixels[static_cast<std::size_t>(i)] = {grey, grey, grey, 255};
        }
        dataset.views.push_back(view);
    }
    return dataset;
}

TrainOptions longTraining() {
    TrainOptions options;
    options.steps = {200, 120, 20, 20};
    options.rays_to_halve = 0;
    return options;
}

}  // namespace

TEST_CASE("long trainings halve voxels near cameras: the same bytes on any number of threads, and when resumed") {
    const TempDir dir;
    const Dataset dataset = closeUps();
    Report silent;
    const TrainResult straight = train(dataset, longTraining(), silent, {});
    REQUIRE(straight.model.field.shells().regions);
    std::size_t halved = 0;
    const VoxelField& field = straight.model.field;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf) {
        const int layer = field.shells().layerAt(field.topology().leafCoords()[leaf].x() * kLeafDim);
        if (field.shells().halvingsOf(layer) > 0) forEachBit(field.topology().cells()[leaf], [&](int) { ++halved; });
    }
    CHECK(halved > 100);
    CHECK(straight.undone_steps == 0);

    const std::string bytes = modelBytes(straight, dir);
    {
        const ThreadLimit one_thread(1);
        CHECK(modelBytes(train(dataset, longTraining(), silent, {}), dir) == bytes);
    }
    for (const int steps : {150, 330}) {  // before cells are halved, and after
        StopAfter report(steps);
        REQUIRE(train(dataset, longTraining(), report, {}, dir / "a.ckpt").interrupted);
        CHECK(modelBytes(train(dataset, longTraining(), silent, {}, dir / "a.ckpt", true), dir) == bytes);
    }
}

TEST_CASE("short trainings halve no voxels, nor those for which someone said how large voxels are") {
    TrainOptions options = longTraining();
    SECTION("few rays") { options.rays_to_halve = TrainOptions().rays_to_halve; }
    SECTION("a size of voxels") { options.voxel_size = 4.0 / 256, options.steps = {360}; }
    Report silent;
    CHECK_FALSE(train(closeUps(), options, silent, {}).model.field.shells().regions);
}

TEST_CASE("no voxel is halved whose halves would not fit into the memory allowed, and a note says so") {
    TrainOptions options = longTraining();
    const ThreadLimit one_thread(1);  // each has memory of its own
    options.max_memory_bytes = std::size_t{180} << 20;
    Report silent;
    const TrainResult result = train(closeUps(), options, silent, {});
    CHECK_FALSE(result.model.field.shells().regions);
    const auto isTold = [](const std::string& note) {
        return note.starts_with("near cameras voxels were not halved") && note.find("--max-memory allows") != std::string::npos;
    };
    CHECK(std::any_of(result.notes.begin(), result.notes.end(), isTold));
}
