// SPDX-License-Identifier: Apache-2.0
// Every measurement runs on the smallest subject and comes back whole. What the figures are is not judged here:
// a busy machine must not fail a test.
#include <cmath>
#include <set>

#include "bench/kernel_rates.h"
#include "bench/mesh_rates.h"
#include "bench/quality.h"
#include "bench/render_sweep.h"
#include "bench/result_plot.h"
#include "bench/scaling.h"
#include "bench/skip.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/simd/kernels.h"
#include "tests/bench/subject.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"
#include "tests/support/xml_check.h"

using namespace nerfvdb;

namespace {

const Subject& sphere() {
    static const Subject subject = test::sphereSubject();
    return subject;
}

/// Cells for every column, finite numbers, names that are unique, and a plot of every series.
void checkWhole(const BenchResult& result, const Plot& plot) {
    REQUIRE(!result.rows.empty());
    std::set<std::string> names;
    for (const BenchRow& row : result.rows) {
        CAPTURE(result.kind, row.series, row.label);
        CHECK(names.insert(row.series + "\n" + row.label).second);
        REQUIRE(row.cells.size() == result.columns.size());
        for (const std::vector<double>& cell : row.cells)
            for (const double value : cell) CHECK(std::isfinite(value));
    }
    CHECK(test::xmlProblem(svgText(plot)) == "");
    TempDir folder;
    writeResult(result, plot, folder.path());
    CHECK(jsonText(readResult(folder / (result.kind + ".json"))) == jsonText(result));
}

const BenchRow& rowOf(const BenchResult& result, const std::string& series, const std::string& label) {
    for (const BenchRow& row : result.rows)
        if (row.series == series && row.label == label) return row;
    throw UsageError("no row " + series + ", " + label);
}

}  // namespace

TEST_CASE("bench render: every knob, and the finer the setting the smaller the error") {
    Report silent;
    const BenchResult result = benchRender(sphere(), {.repeats = 2}, silent);
    checkWhole(result, renderPlot(result));
    const auto error = [&](const char* knob, const char* value) {
        return result.median(rowOf(result, knob, value), "psnr_finest");
    };
    CHECK(error("step, voxels", "0.25") > error("step, voxels", "2"));
    CHECK(error("least weight", "0") > error("least weight", "0.03"));
    CHECK(error("stop transmittance", "0") > error("stop transmittance", "0.05"));
    CHECK(error("resolution", "1") > error("resolution", "0.25"));
    // A body with a steep edge has hardly a cell of small alpha: fewer samples, no visible error.
    const auto samples = [&](const char* value) {
        return result.median(rowOf(result, "least alpha of a cell", value), "density_samples");
    };
    CHECK(samples("0") > samples("0.2"));
    // The default stands in every series, and is the same there.
    CHECK(error("step, voxels", "0.5") == error("least weight", "0.001"));
    CHECK(error("step, voxels", "0.5") == error("resolution", "1"));
    CHECK(rowOf(result, "step, voxels", "0.5").cells[result.column("seconds")].size() == 2);
    CHECK(!renderPlot(result).front.empty());
    // Half precision changes something, but little beside what the default step leaves out.
    CHECK(error("bits of a value", "16") != error("bits of a value", "32"));
    CHECK(std::abs(error("bits of a value", "16") - error("bits of a value", "32")) < 0.5);
}

TEST_CASE("enlarging: constants and slopes come through, size is the one asked for") {
    Image slope(4, 3, 3);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x)
            for (int c = 0; c < 3; ++c) slope.at(x, y)[c] = static_cast<float>(x) + 10 * static_cast<float>(y);
    const Image large = enlarged(slope, 8, 6);
    CHECK(large.width == 8);
    CHECK(large.height == 6);
    CHECK(large.at(0, 0)[0] == Approx(0));
    // Pixel 3 of 8 has its centre at 3.5 / 2 - 0.5 = 1.25 of 4.
    CHECK(large.at(3, 2)[1] == Approx(1.25 + 10 * 0.75));
    CHECK(large.at(7, 5)[2] == Approx(23));
}

TEST_CASE("bench scaling: every series at one thread has the speed-up one") {
    Report silent;
    const BenchResult result =
        benchScaling(sphere(), {.repeats = 1, .batches = {64, 256}, .scales = {1.0}}, silent);
    checkWhole(result, scalingPlot(result));
    for (const char* series : {"training, 64 rays", "training, 256 rays", "rendering, 32x32"}) {
        const BenchRow& row = rowOf(result, series, "1 thread");
        CHECK(result.median(row, "speedup") == 1);
        CHECK(result.median(row, "rays_per_s") > 0);
    }
    for (const char* order : {"by leaf, in the order of rays", "as they come"})
        CHECK(result.median(rowOf(result, "gradients to voxels, 256 rays", order), "seconds") > 0);
    CHECK(result.figures[result.figures.size() - 2].first ==
          "what the order of gradients costs, share of a step of 256 rays");
    const double share = result.figures.back().second;
    CHECK(share > 0.2);  // the sphere fills more than that of its pictures
    CHECK(share <= 1);
}

TEST_CASE("bench skip: not skipping costs samples and leaves pictures as they were") {
    Report silent;
    const BenchResult result = benchSkip(sphere(), {.repeats = 1, .batch = 256, .train_steps = 1000}, silent);
    checkWhole(result, skipPlot(result));
    const auto more = [&](const char* label, const char* kind) {
        const BenchRow& row = rowOf(result, "rendering", label);
        return result.median(row, std::string(kind) + "_without") /
               result.median(row, std::string(kind) + "_with");
    };
    CHECK(more("empty leaves", "density") == 1);
    CHECK(more("empty voxels", "density") > 1.1);
    CHECK(more("behind surfaces", "density") > 1.1);
    CHECK(more("negligible weights", "features") > 1.1);
    CHECK(more("rays that meet nothing", "density") == 1);  // what they are spared is the network
    CHECK(more("all of these", "density") > 3);
    for (const BenchRow& row : result.rows) {
        if (row.series != "rendering") continue;
        CAPTURE(row.label);
        // The sampled sphere is a thick, smooth body: what is skipped there shows below 1 % of an 8-bit level.
        CHECK(std::abs(result.median(row, "psnr_with") - result.median(row, "psnr_without")) < 0.2);
    }
    CHECK(result.median(rowOf(result, "training", "rays that meet nothing"), "slowdown") > 0);
    CHECK(rowOf(result, "training", "empty leaves").cells[result.column("psnr_with")].empty());
    const BenchRow& unseen = rowOf(result, "whole training", "voxels that no view sees");
    CHECK(result.median(unseen, "psnr_with") > 12);
    CHECK(std::abs(result.median(unseen, "psnr_with") - result.median(unseen, "psnr_without")) < 3);
    const auto figure = [&](const std::string& name) {
        for (const auto& [key, value] : result.figures)
            if (key == name) return value;
        throw UsageError("no figure " + name);
    };
    // Inside the sphere nothing is seen.
    CHECK(figure("active voxels, without those that no view sees") < figure("active voxels, with them"));
    const BenchRow& everything = rowOf(result, "whole training", "all of these");
    CHECK(result.median(everything, "psnr_with") > 12);
    CHECK(result.median(everything, "psnr_without") > 12);
    CHECK(figure("active voxels of 128 a side, nothing skipped") > 128 * 60 * 60);  // all of the box
    CHECK(figure("active voxels of 128 a side, with skipping") <
          0.25 * figure("active voxels of 128 a side, nothing skipped"));  // what a ball's surface takes of it
}

TEST_CASE("skipping that costs more than a twentieth of a decibel is named") {
    BenchResult result;
    result.columns = {{"psnr_with"}, {"psnr_without"}};
    result.rows = {{"rendering", "cheap", {{30}, {30.04}}},
                   {"rendering", "dear", {{30}, {30.07}}},
                   {"rendering", "better than nothing", {{30}, {29}}},
                   {"training", "not scored", {{}, {}}},
                   {"rendering", "broken", {{NAN}, {30}}}};
    CHECK(costlySkips(result) == std::vector<std::string>{"rendering, dear: 0.07 dB", "rendering, broken: nan dB"});
}

TEST_CASE(
    "bench kernels: every kernel on every instruction set and in the reference; the best is left active") {
    Report silent;
    const std::string best = simd::activeTarget();
    const BenchResult result =
        benchKernels({.repeats = 1, .min_sample_s = 0, .tiles = 4, .resolution = 32, .channels = 4}, silent);
    checkWhole(result, kernelPlot(result));
    std::set<std::string> series;
    for (const BenchRow& row : result.rows) series.insert(row.series);
    for (const std::string& target : simd::supportedTargets()) CHECK(series.count(target) == 1);
    CHECK(series.count("scalar reference") == 1);
    CHECK(rowOf(result, "scalar reference", "densityForward").cells[0].size() == 1);
    CHECK(result.median(rowOf(result, best, "layerForward, a ray"), "times_floor") > 0.9);
    CHECK(std::isnan(result.median(rowOf(result, "scalar reference", "densityForward"), "times_floor")));
    CHECK(simd::activeTarget() == best);
}

TEST_CASE("bench mesh: each way has the same surface, and memory and rates are there") {
    Report silent;
    TempDir folder;
    const BenchResult result = benchMesh({.repeats = 1, .resolution = 64, .scratch = folder.path()}, silent);
    checkWhole(result, meshPlot(result));
    for (const char* scene : {"bumpy shell in 64^3", "gyroid in a ball in 64^3"}) {
        const std::string series = std::string(scene) + ", 1 thread";
        const double own = result.median(rowOf(result, series, "nerfvdb"), "triangles");
        CHECK(own > 10000);
        // Dual quads are as many as crossed edges, cut in two; marching cubes differs by its handles.
        CHECK(result.median(rowOf(result, series, "OpenVDB volumeToMesh"), "triangles") == Approx(own).epsilon(0.02));
        CHECK(result.median(rowOf(result, series, "nerfvdb"), "memory_over_output") < 10);
        CHECK(result.median(rowOf(result, series, "nerfvdb"), "triangles_per_cpu_s") > 0);
    }
    CHECK(std::filesystem::is_empty(folder.path()));
    const std::string threads = std::to_string(threadCount()) + (threadCount() == 1 ? " thread" : " threads");
    for (const char* what : {"density", "density and color"})
        for (const char* way : {"nerfvdb export", "nerfvdb writing", "OpenVDB writing"}) {
            const std::string series = std::string("making a .vdb, ") + what + ", " + threads;
            CHECK(result.median(rowOf(result, series, way), "voxels_per_s") > 0);
        }
}

TEST_CASE("bench quality: separate runs with repeats, looks at one run, nothing left behind") {
    Report silent;
    const BenchScene scene = proceduralScene(
        "sphere", {.train_views = 12, .val_views = 0, .test_views = 3, .width = 48, .height = 48, .seed = 1},
        silent);
    TempDir folder;
    const BenchResult result =
        benchQuality({&scene, 1}, {.times_s = {1.0}, .seeds = 2, .views = 2, .scratch = folder.path()}, silent);
    checkWhole(result, qualityPlot(result));
    REQUIRE(result.rows.size() == 1);
    const BenchRow& row = result.rows[0];
    CHECK(row.series == "sphere");
    CHECK(row.label == "1 s");
    CHECK(row.cells[result.column("psnr")].size() == 2);
    CHECK(result.median(row, "psnr") > 15);  // it learned something
    CHECK(result.median(row, "rays") > 0);
    CHECK(result.median(row, "model_bytes") > 0);

    // One run with looks: time and steps go on, and the end is the whole run.
    const BenchResult looks = benchQuality(
        {&scene, 1},
        {.presets = {Preset::fast}, .preset_steps = 400, .first_look_s = 0.05, .scratch = folder.path()},
        silent);
    checkWhole(looks, qualityPlot(looks));
    REQUIRE(looks.rows.size() >= 2);
    for (std::size_t r = 1; r < looks.rows.size(); ++r) {
        CHECK(looks.median(looks.rows[r], "seconds") > looks.median(looks.rows[r - 1], "seconds"));
        CHECK(looks.median(looks.rows[r], "steps") > looks.median(looks.rows[r - 1], "steps"));
        CHECK(looks.median(looks.rows[r], "rays") > looks.median(looks.rows[r - 1], "rays"));
    }
    CHECK(looks.rows.back().series == "sphere, fast");
    CHECK(looks.rows.back().label == "end");
    CHECK(looks.median(looks.rows.back(), "steps") == 400);
    CHECK(std::filesystem::is_empty(folder.path()));
    CHECK_THROWS_AS(benchQuality({}, {}, silent), UsageError);
}
