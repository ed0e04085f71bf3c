// SPDX-License-Identifier: Apache-2.0
#include "trainer/step_guard.h"

#include <cstring>
#include <limits>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/temp_dir.h"
#include "trainer/checkpoint.h"
#include "trainer/possible_cells.h"
#include "trainer/trainer.h"

using namespace nerfvdb;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

const Dataset& sphere() {
    static const Dataset dataset = test::sphereDataset(Split::train, 12, 48);
    return dataset;
}

TrainState freshState() {
    const BoxGrid grid = gridOver({Vec3d::Constant(-0.9), Vec3d::Constant(0.9)}, 32);
    TrainState state;
    state.decoder = Decoder(8, 3, 32);
    state.field = VoxelField(Topology(grid.dims, possibleCells(sphere(), grid, 2)), grid.frame, 8, 140.0);
    test::setDensity(state.field, [](const Vec3i&) { return -3.0f; });
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    state.seen.assign(state.field.topology().leafCount(), {});
    state.occupancy = findOccupied(state.field, 0.01f);
    return state;
}

std::vector<float> copyOf(std::span<const float> values) { return {values.begin(), values.end()}; }
bool sameBytes(const std::vector<float>& a, std::span<const float> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), b.size_bytes()) == 0;
}

}  // namespace

TEST_CASE("a step that meets NaN everywhere is tried three times, moves nothing, and names the ray") {
    TrainState state = freshState();
    for (float& value : state.field.features()) value = kNan;
    RaySource source(sphere(), 11);
    source.update(state.field, state.occupancy);
    const std::vector<float> density = copyOf(state.field.density()),
                             network = copyOf(state.decoder.parameters());
    TrainStepper stepper;
    StepGuard guard;
    const StepReport report = guard.step(stepper, state, source, 7, 64, {}, {});
    CHECK_FALSE(report.is_finite);
    CHECK(guard.undone() == 3);
    CHECK(sameBytes(density, state.field.density()));
    CHECK(sameBytes(network, state.decoder.parameters()));
    const std::string sentence = StepGuard::complaint(report, 7, sphere());
    CHECK(sentence.find("at step 7, image view " + std::to_string(report.bad.view)) != std::string::npos);
    CHECK(sentence.find("--debug-ray " + std::to_string(report.bad.view) + ":" + std::to_string(report.bad.x) + ":" +
                        std::to_string(report.bad.y) + ":0.") != std::string::npos);
}

TEST_CASE("a step that meets one voxel of NaN is done with other rays, at a lower rate") {
    TrainState state = freshState();
    RaySource source(sphere(), 11);
    source.update(state.field, state.occupancy);
    // A voxel just inside the sphere, in sight from a side: few rays of a small batch meet it.
    std::size_t place = 0;
    test::forEachVoxel(state.field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        if (ijk == Vec3i(16, 16, 26)) place = i;
    });
    REQUIRE(place > 0);
    state.field.features()[place * 8] = kNan;
    TrainStepper stepper;
    StepGuard guard;
    int n_recovered = 0;
    for (std::uint64_t step = 0; step < 60; ++step) {
        const std::uint64_t undone = guard.undone();
        const StepReport report = guard.step(stepper, state, source, step, 64, {}, {});
        if (report.is_finite && guard.undone() > undone) ++n_recovered;
    }
    CHECK(n_recovered > 0);
    for (const float value : state.decoder.parameters()) REQUIRE(std::isfinite(value));
}

TEST_CASE("gradients too large to square move nothing") {
    TrainState state = freshState();
    RaySource source(sphere(), 11);
    source.update(state.field, state.occupancy);
    state.distortion = 1e22f;  // its gradient is a small multiple
    const std::vector<float> density = copyOf(state.field.density());
    TrainStepper stepper;
    StepGuard guard;
    const StepReport report = guard.step(stepper, state, source, 0, 64, {}, {});
    CHECK_FALSE(report.is_finite);
    CHECK(report.bad.view >= 0);
    CHECK(sameBytes(density, state.field.density()));
}

TEST_CASE("training that goes on from a damaged state stops with a sentence, and its checkpoint stays") {
    const TempDir dir;
    TrainOptions options;
    options.preset = Preset::fast;
    options.steps = {12, 40};
    struct StopSoon : Report {
        mutable int asked = 0;
        bool cancelled() const override { return ++asked > 6; }
    } stop;
    const auto checkpoint = dir / "m.ckpt";
    const TrainResult begun = train(sphere(), options, stop, {}, checkpoint);
    REQUIRE(begun.interrupted);
    CHECK(begun.undone_steps == 0);
    TrainState state;
    TrainPlace place;
    loadCheckpoint(checkpoint, state, place);
    for (float& value : state.decoder.parameters()) value = kNan;
    saveCheckpoint(checkpoint, state, place);
    const std::string before = readFile(checkpoint);

    Report silent;
    const TrainResult result = train(sphere(), options, silent, {}, checkpoint, /*resume=*/true);
    CHECK(result.undone_steps == 3);
    CHECK_FALSE(result.interrupted);
    CHECK(result.steps == begun.steps);
    CHECK(result.numeric_error.find("3 times in a row at step " + std::to_string(begun.steps)) !=
          std::string::npos);
    CHECK(readFile(checkpoint) == before);
}

TEST_CASE("a camera that is no camera is named before training begins") {
    Dataset dataset = sphere();
    dataset.views[4].camera.position.y() = std::numeric_limits<double>::infinity();
    Report silent;
    CHECK_THROWS_WITH(train(dataset, {}, silent, {}),
                      Catch::Matchers::Contains("view 4: camera: pose is not finite"));
}
