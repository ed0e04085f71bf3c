// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint.h"

#include <string>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "tests/support/small_disk.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/stopped_training.h"
#include "tests/support/temp_dir.h"
#include "trainer/checkpoint_writer.h"
#include "trainer/trainer.h"

using namespace nerfvdb;
using test::modelBytes;
using test::StopAfter;

namespace {

const Dataset& sphere() {
    static const Dataset dataset = test::sphereDataset(Split::train, 12, 48);
    return dataset;
}

TrainOptions shortRun() {
    TrainOptions options;
    options.steps = {36, 40, 10, 6};  // two refinements, and an occupancy update in the first two stages
    options.seed = 7;
    return options;
}

/// The same of photographs without alpha, as of a place.
TrainOptions openRun() {
    TrainOptions options = shortRun();
    options.extent = SceneExtent::open;
    return options;
}

Dataset opaqueSphere() {
    Dataset opaque = sphere();
    opaque.has_alpha = false;
    return opaque;
}

TrainResult trainTo(const std::filesystem::path& checkpoint, Report& report, bool resume) {
    return train(sphere(), shortRun(), report, {}, checkpoint, resume);
}

struct Loaded {
    TrainState state;
    TrainPlace place;
};

Loaded load(const std::filesystem::path& checkpoint) {
    Loaded loaded;
    loadCheckpoint(checkpoint, loaded.state, loaded.place);
    return loaded;
}

/// What a training stands at that was stopped after so many steps, by way of its checkpoint.
Loaded stoppedAfter(int steps, const std::filesystem::path& checkpoint) {
    StopAfter report(steps);
    trainTo(checkpoint, report, false);
    return load(checkpoint);
}

}  // namespace

TEST_CASE("a checkpoint that is loaded and saved again repeats the file") {
    const TempDir dir;
    const auto [state, place] = stoppedAfter(50, dir / "a.ckpt");
    CHECK(place.step == 50);
    CHECK(place.stage == 1);
    CHECK(place.step_in_stage == 14);
    saveCheckpoint(dir / "b.ckpt", state, place);
    CHECK(readFile(dir / "a.ckpt") == readFile(dir / "b.ckpt"));
}

TEST_CASE("a checkpoint from a copy of the state is the same file, of a size known beforehand") {
    const TempDir dir;
    auto [state, place] = stoppedAfter(50, dir / "a.ckpt");
    const PackedCheckpoint packed = packCheckpoint(state, place);
    CHECK(packed.size == checkpointBytes(state, place));
    saveCheckpoint(dir / "b.ckpt", packed);
    const std::string expected = readFile(dir / "a.ckpt");
    CHECK(expected.size() > 1000000);
    CHECK(readFile(dir / "b.ckpt") == expected);

    CheckpointWriter writer(dir / "c.ckpt");
    CHECK_FALSE(writer.outcome());
    writer.begin(packCheckpoint(state, place));
    state.field = {};  // the copy is all that the writer needs
    writer.wait();
    CHECK_FALSE(writer.isBusy());
    CHECK(writer.outcome() == std::optional<std::string>(""));
    CHECK_FALSE(writer.outcome());
    CHECK(readFile(dir / "c.ckpt") == expected);
}

TEST_CASE("training at a level that only --voxel-size has is resumed, too") {
    // A long thin box, of which few voxels fill 1024 along its side: five levels.
    TrainOptions options;
    options.bounds = Box{{-0.9, -0.05, -0.05}, {0.9, 0.05, 0.05}};
    options.voxel_size = 1.8 / 1024;
    options.steps = {20, 8, 6, 4, 4, 4};
    const TempDir dir;
    Report silent;
    const TrainResult whole = train(sphere(), options, silent, {}, dir / "whole.ckpt", false);
    CHECK(whole.model.field.frame().voxel_size == *options.voxel_size);
    StopAfter soon(43);
    train(sphere(), options, soon, {}, dir / "cut.ckpt", false);
    const TrainResult resumed = train(sphere(), {}, silent, {}, dir / "cut.ckpt", true);
    CHECK(resumed.steps == whole.steps);
    CHECK(modelBytes(resumed, dir) == modelBytes(whole, dir));
}

TEST_CASE("a checkpoint that the second thread cannot write says why") {
    const TempDir dir;
    const auto [state, place] = stoppedAfter(1, dir / "a.ckpt");
    CheckpointWriter writer(dir / "absent" / "b.ckpt");
    writer.begin(packCheckpoint(state, place));
    writer.wait();
    const std::optional<std::string> error = writer.outcome();
    REQUIRE(error);
    CHECK_THAT(*error, Catch::Contains("b.ckpt") && Catch::Contains("no folder"));
}

TEST_CASE("checkpoints at every step change nothing, and one of them resumes", "[slow]") {
    const TempDir dir;
    TrainOptions options = shortRun();
    options.checkpoint_s = 1e-6;
    Report silent;
    const TrainResult expected = train(sphere(), shortRun(), silent, {});
    const std::string bytes = modelBytes(expected, dir);
    const TrainResult result = train(sphere(), options, silent, {}, dir / "a.ckpt");
    CHECK(result.checkpoint_error.empty());
    CHECK(modelBytes(result, dir) == bytes);
    CHECK(modelBytes(train(sphere(), options, silent, {}, dir / "a.ckpt", true), dir) == bytes);
}

TEST_CASE("a checkpoint of an open scene keeps its shells and its sky, and goes on to the same file") {
    const TempDir dir;
    const TrainOptions options = openRun();
    const Dataset opaque = opaqueSphere();
    StopAfter report(50);
    REQUIRE(train(opaque, options, report, {}, dir / "a.ckpt").interrupted);
    const auto [state, place] = load(dir / "a.ckpt");
    CHECK(state.field.shells().count > 3);
    CHECK(state.field.shells().fits(state.field.topology().dims()));
    CHECK_FALSE(state.sky.isEmpty());
    CHECK(state.sky_optimizer.count > 0);
    saveCheckpoint(dir / "b.ckpt", state, place);
    CHECK(readFile(dir / "a.ckpt") == readFile(dir / "b.ckpt"));

    Report silent;
    const TrainResult straight = train(opaque, options, silent, {});
    const ThreadLimit other_threads(1);
    const TrainResult resumed = train(opaque, options, silent, {}, dir / "a.ckpt", true);
    CHECK(modelBytes(resumed, dir) == modelBytes(straight, dir));
}

TEST_CASE("a checkpoint keeps the regions whose cells are halved") {
    const TempDir dir;
    StopAfter report(5);
    REQUIRE(train(opaqueSphere(), openRun(), report, {}, dir / "a.ckpt").interrupted);
    auto [state, place] = load(dir / "a.ckpt");
    state.field = test::nestedField(Vec3i(32, 16, 48), 3, state.field.channels());
    const Vec3i dims(4, 2, 3);
    std::vector<std::uint8_t> halvings(static_cast<std::size_t>(3 * dims.prod()), 0);
    halvings[4] = 2, halvings[30] = 1;
    state.field = test::halvedField(std::move(state.field), dims, halvings);
    const std::size_t leaves = state.field.topology().leafCount();
    state.density_moment = HugeArray<float>(state.field.density().size());
    state.feature_moment = HugeArray<float>(state.field.density().size());
    state.seen.assign(leaves, {});
    state.occupancy = findOccupied(state.field, 0);
    CHECK_FALSE(place.has_asked_voxels);
    place.has_asked_voxels = true;  // then a resumed training halves none
    saveCheckpoint(dir / "b.ckpt", state, place);
    const auto [again, place_again] = load(dir / "b.ckpt");
    CHECK(place_again.has_asked_voxels);
    CHECK(place_again.tries_exposure == place.tries_exposure);
    REQUIRE(again.field.shells().regions);
    CHECK(again.field.shells().regions->dims == dims);
    CHECK(again.field.shells().regions->halvings == halvings);
    CHECK(again.field.topology().cellCount() == state.field.topology().cellCount());
    saveCheckpoint(dir / "c.ckpt", again, place_again);
    CHECK(readFile(dir / "b.ckpt") == readFile(dir / "c.ckpt"));

    Shells other = state.field.shells();
    halvings[5] = 1;
    other.regions = makeRegions(3, dims, halvings);
    state.field = VoxelField(state.field.topology(), state.field.frame(), other, state.field.channels(), 1.0);
    saveCheckpoint(dir / "d.ckpt", state, place);
    CHECK_THROWS_AS(load(dir / "d.ckpt"), DataError);  // cells that are not halved in a region that is
}

TEST_CASE("a preset decides how much a voxel and the network hold, and a checkpoint keeps it") {
    struct Case {
        std::optional<Preset> preset;
        std::optional<double> time_s;
        bool with_steps;
        int channels, width;
    };
    for (const Case& c : {Case{Preset::fast, {}, true, 8, 64}, {Preset::standard, {}, true, 8, 128},
                          {Preset::best, {}, true, 16, 256}, {{}, {}, true, 8, 128}, {{}, 20.0, false, 8, 64},
                          {{}, 20.0, true, 8, 128}, {{}, 200.0, false, 8, 128}, {Preset::best, 20.0, false, 16, 256}}) {
        const TempDir dir;
        StopAfter report(2);
        TrainOptions options = shortRun();
        options.preset = c.preset;
        options.time_s = c.time_s;
        if (!c.with_steps) options.steps.clear();
        train(sphere(), options, report, {}, dir / "a.ckpt");
        const auto [state, place] = load(dir / "a.ckpt");
        CHECK(state.field.channels() == c.channels);
        CHECK(state.decoder.width() == c.width);
        saveCheckpoint(dir / "b.ckpt", state, place);
        CHECK(readFile(dir / "a.ckpt") == readFile(dir / "b.ckpt"));
    }
}

TEST_CASE("training that was stopped and resumed, anywhere, gives the same files as training straight on", "[slow]") {
    const TempDir dir;
    Report silent;
    const TrainResult straight = trainTo(dir / "straight.ckpt", silent, false);
    REQUIRE(straight.steps == 92);
    const std::string expected = modelBytes(straight, dir);
    // At the very start, inside a stage, at a stage's last step, at an occupancy update, and near the end.
    for (const int stop : {0, 1, 36, 50, 68, 91}) {
        CAPTURE(stop);
        StopAfter report(stop);
        const TrainResult part = trainTo(dir / "parts.ckpt", report, false);
        REQUIRE(part.interrupted);
        REQUIRE(part.steps == stop);
        const ThreadLimit other_threads(1);  // which must not matter
        const TrainResult whole = trainTo(dir / "parts.ckpt", silent, true);
        CHECK_FALSE(whole.interrupted);
        CHECK(whole.steps == 92);
        CHECK(modelBytes(whole, dir) == expected);
        CHECK(readFile(dir / "parts.ckpt") == readFile(dir / "straight.ckpt"));
    }
}

TEST_CASE("what is not a whole checkpoint of this version is refused, and says why") {
    const TempDir dir;
    StopAfter report(3);
    trainTo(dir / "good.ckpt", report, false);
    const std::string good = readFile(dir / "good.ckpt");
    const auto loadBytes = [&](std::string_view bytes) {
        writeAtomically(dir / "bad.ckpt", bytes);
        load(dir / "bad.ckpt");
    };
    CHECK_THROWS_AS(load(dir / "none.ckpt"), IoError);
    CHECK_THROWS_WITH(loadBytes(""), Catch::Contains("bad.ckpt") && Catch::Contains("another kind of file"));
    CHECK_THROWS_WITH(loadBytes("P6 a picture of something else"), Catch::Contains("another kind of file"));
    std::string newer = good;
    newer[std::string("nerfvdb-checkpoint ").size()] = '9';
    CHECK_THROWS_WITH(loadBytes(newer), Catch::Contains("another version"));
    for (const std::size_t place_of_damage :
         {good.size() - 1, good.size() / 2, std::size_t{60}, std::size_t{30}}) {
        std::string damaged = good;
        damaged[place_of_damage] = static_cast<char>(damaged[place_of_damage] ^ 4);
        CHECK_THROWS_WITH(loadBytes(damaged), Catch::Contains("damaged or truncated"));
    }
    for (const std::size_t length : {good.size() - 1, good.size() / 2, std::size_t{40}})
        CHECK_THROWS_WITH(loadBytes(good.substr(0, length)), Catch::Contains("damaged or truncated"));
    CHECK_THROWS_AS(loadBytes(good + "x"), DataError);
    CHECK_NOTHROW(loadBytes(good));
}

TEST_CASE("a checkpoint whose background is of no kind is refused") {
    const TempDir dir;
    StopAfter report(3);
    trainTo(dir / "good.ckpt", report, false);
    TrainState state;
    TrainPlace place;
    loadCheckpoint(dir / "good.ckpt", state, place);
    state.behind = static_cast<Behind>(3);
    saveCheckpoint(dir / "bad.ckpt", state, place);
    CHECK_THROWS_WITH(load(dir / "bad.ckpt"), Catch::Contains("fields that do not fit"));
}

TEST_CASE("resuming with another data set is refused") {
    const TempDir dir;
    StopAfter report(3);
    trainTo(dir / "a.ckpt", report, false);
    Dataset fewer = sphere();
    fewer.views.pop_back();
    Report silent;
    CHECK_THROWS_WITH(train(fewer, shortRun(), silent, {}, dir / "a.ckpt", true),
                      Catch::Contains("12 views") && Catch::Contains("11"));
    const std::string refused = (dir / "a.ckpt").string() +
                                ": found training on other cameras or photographs, expected those of sphere; resume "
                                "with the data that it was made from, or train without --resume";
    Dataset other = sphere();
    other.views[3].camera.position.x() += 1e-9;
    CHECK_THROWS_WITH(train(other, shortRun(), silent, {}, dir / "a.ckpt", true), refused);
    other = sphere();
    other.views.back().photo.pixels.back()[2] += 1;
    CHECK_THROWS_WITH(train(other, shortRun(), silent, {}, dir / "a.ckpt", true), refused);
}

TEST_CASE("a checkpoint that finds no room is lost alone: what was learned is not") {
    const TempDir dir;
    StopAfter roomy(20), tight(20);
    const TrainResult expected = trainTo(dir / "roomy.ckpt", roomy, false);
    CHECK(expected.checkpoint_error.empty());
    const TrainResult result = [&] {
        const SmallDisk full_disk(1000);
        return trainTo(dir / "tight.ckpt", tight, false);
    }();
    CHECK(result.interrupted);
    CHECK(result.checkpoint_error.find("tight.ckpt: found") != std::string::npos);
    REQUIRE(tight.warnings.size() == 1);
    CHECK(tight.warnings[0] == "checkpoint not written, training goes on: " + result.checkpoint_error);
    CHECK_FALSE(std::filesystem::exists(dir / "tight.ckpt"));
    CHECK(modelBytes(result, dir) == modelBytes(expected, dir));
}
