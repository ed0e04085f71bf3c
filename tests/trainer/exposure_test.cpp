// SPDX-License-Identifier: Apache-2.0
#include "trainer/exposure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/atomic_file.h"
#include "core/parallel.h"
#include "tests/support/catch.h"
#include "tests/support/random_field.h"
#include "tests/support/sphere_dataset.h"
#include "tests/support/stopped_training.h"
#include "tests/support/temp_dir.h"
#include "tests/support/varied_exposure.h"
#include "trainer/evaluate.h"
#include "trainer/trainer.h"

using namespace nerfvdb;
using test::modelBytes;
using test::StopAfter;

namespace {

/// Colours are about one; single precision leaves 1e-7 of them.
constexpr double kRounding = 1e-6;

Exposure randomExposure(std::uint64_t seed) {
    Exposure exposure;
    for (int i = 0; i < 9; ++i) exposure.matrix[i] = test::randomIn(-0.5f, 0.5f, seed, i);
    for (int i = 0; i < 3; ++i) exposure.offset[i] = test::randomIn(-0.5f, 0.5f, seed, 9 + i);
    return exposure;
}

/// Light of rays over three views, and what their photographs show of it by the exposures of `truth`.
struct Capture {
    std::vector<ExposedRay> rays;
    std::vector<std::array<float, 3>> targets;
};

Capture capture(Exposures& truth, int n_rays) {
    Capture result;
    for (int r = 0; r < n_rays; ++r) {
        ExposedRay ray{r % 3, {}, 1, {}};
        for (int c = 0; c < 3; ++c) ray.light[c] = test::randomIn(0.1f, 0.9f, 60, 3 * r + c);
        std::array<float, 3> target;
        truth.of(ray.view).forward(ray.light, ray.coverage, target.data());
        result.rays.push_back(ray);
        result.targets.push_back(target);
    }
    return result;
}

TrainOptions shortRun(ExposureMode mode) {
    TrainOptions options;
    options.steps = {36, 30, 6};
    options.bounds = Box{Vec3d::Constant(-1), Vec3d::Constant(1)};
    options.exposure = mode;
    return options;
}

const Dataset& variedSphere() {
    static const Dataset dataset = test::exposed(test::sphereDataset(Split::train, 12, 48), test::randomExposures(12));
    return dataset;
}

}  // namespace

TEST_CASE("an exposure's derivative is that of its map") {
    // The map is linear in light, coverage, matrix and offset: differences over any distance are exact.
    const Exposure exposure = randomExposure(1);
    const float light[3] = {0.3f, 0.6f, 0.2f}, coverage = 0.7f, slope[3] = {0.5f, -1, 2};
    const auto loss = [&](const Exposure& map, const float* at, float share) {
        float color[3];
        map.forward(at, share, color);
        return static_cast<double>(slope[0] * color[0] + slope[1] * color[1] + slope[2] * color[2]);
    };
    float dl_dlight[3];
    const float dl_dcoverage = exposure.backward(slope, dl_dlight);
    const double here = loss(exposure, light, coverage);
    for (int c = 0; c < 3; ++c) {
        float moved[3] = {light[0], light[1], light[2]};
        moved[c] += 1;
        CHECK(static_cast<double>(dl_dlight[c]) == Approx(loss(exposure, moved, coverage) - here).margin(kRounding));
    }
    CHECK(static_cast<double>(dl_dcoverage) == Approx(loss(exposure, light, coverage + 1) - here).margin(kRounding));

    Exposures exposures(2, true);
    const ExposedRay ray{1, {light[0], light[1], light[2]}, coverage, {slope[0], slope[1], slope[2]}};
    std::vector<double> gradient(2 * Exposures::kValues);
    exposures.addGradient(std::vector{ray, ray}, gradient);
    for (int i = 0; i < Exposures::kValues; ++i) {
        Exposure moved = exposure;
        (i < 9 ? moved.matrix[i] : moved.offset[i - 9]) += 1;
        const double expected = 2 * (loss(moved, light, coverage) - here);  // of two equal rays
        CHECK(gradient[Exposures::kValues + i] == Approx(expected).margin(2 * kRounding));
        CHECK(gradient[i] == 0);
    }
}

TEST_CASE("exposures that nobody learned change no bit of a colour") {
    const float light[3] = {0.1f, 0.7f, 0.33333333f};
    for (const Exposures& exposures : {Exposures(), Exposures(3, true)}) {
        float color[3], back[3];
        exposures.of(2).forward(light, 0.4f, color);
        CHECK(exposures.of(2).backward(light, back) == 0);
        for (int c = 0; c < 3; ++c) CHECK((color[c] == light[c] && back[c] == light[c]));
    }
    CHECK_FALSE(Exposures().learned());
    CHECK(Exposures(3, true).learned());
}

TEST_CASE("exposures are found again from what photographs show, and their mean stays the identity") {
    Exposures truth(3, true);
    // Of two views; the third undoes them, so that the mean is the identity.
    for (int i = 0; i < Exposures::kValues; ++i)
        for (int v = 0; v < 2; ++v) {
            const float value = test::randomIn(-0.2f, 0.2f, 61 + v, i);
            truth.values()[v * Exposures::kValues + i] = value;
            truth.values()[2 * Exposures::kValues + i] -= value;
        }
    Capture seen = capture(truth, 300);
    Exposures learned(3, true);
    for (int step = 0; step < 1500; ++step) {
        for (std::size_t r = 0; r < seen.rays.size(); ++r) {
            ExposedRay& ray = seen.rays[r];
            float color[3];
            learned.of(ray.view).forward(ray.light, ray.coverage, color);
            for (int c = 0; c < 3; ++c) ray.dl_dcolor[c] = 2 * (color[c] - seen.targets[r][c]);
        }
        std::vector<double> gradient(learned.values().size());
        learned.addGradient(seen.rays, gradient);
        learned.step(gradient, seen.rays.size(), step < 1000 ? 5e-3f : 5e-4f);
        if (step % 100 == 0)
            for (int i = 0; i < Exposures::kValues; ++i) {
                double mean = 0;
                for (int v = 0; v < 3; ++v) mean += learned.values()[v * Exposures::kValues + i] / 3.0;
                CHECK(std::abs(mean) < kRounding);
            }
    }
    // What draws towards the identity costs up to two hundredths of what is looked for, where light varies little.
    for (std::size_t i = 0; i < truth.values().size(); ++i)
        CHECK(std::abs(learned.values()[i] - truth.values()[i]) < 0.02f);
}

TEST_CASE("a gain that drifts from photograph to photograph is not its own, one that jumps is") {
    constexpr int kViews = 400;
    std::vector<int> before(kViews);
    for (int v = 0; v < kViews; ++v) before[v] = std::max(1, v) - 1;
    before[0] = 1;
    const auto ownSpread = [&](const auto& gain) {
        Exposures exposures(kViews, true);
        for (int v = 0; v < kViews; ++v)
            for (int c = 0; c < 3; ++c) exposures.values()[v * Exposures::kValues + 4 * c] = gain(v);
        return exposures.ownSpread(before);
    };
    // Up by 40 % in even steps, with one leap, as where a walk goes through a door.
    CHECK(ownSpread([](int v) { return 0.001f * static_cast<float>(v) + (v > 200 ? 0.3f : 0); }) ==
          Approx(0.001 / 1.627).epsilon(1e-3));
    // Independent: even within 0.1 either side. Three quarters of the differences are below 0.2 (1 - sqrt(1/4)), and 400 leave
    // their quartile an error of 4 %.
    CHECK(ownSpread([](int v) { return test::randomIn(-0.1f, 0.1f, 63, v); }) == Approx(0.1 / 1.627).epsilon(0.12));
    // Every third photograph is another camera's.
    CHECK(ownSpread([](int v) { return v % 3 == 0 ? 0.2f : 0; }) == Approx(0.2 / 1.627).epsilon(1e-3));
    CHECK(Exposures().ownSpread({}) == 0);
}

TEST_CASE("photographs of many exposures: learned, held-out pictures of the mean one are right", "[slow]") {
    const Dataset photographs = test::surroundedSphereDataset(24, 100);
    const Dataset varied = test::exposed(photographs, test::randomExposures(24));
    // Three are a little brighter: a wall that is the same in all would be a plain background, of which more is known.
    std::vector<std::array<double, 6>> nearly_equal(24, {1, 1, 1, 0, 0, 0});
    for (std::size_t v = 0; v < 24; v += 8) nearly_equal[v] = {1, 1, 1, 0.02, 0.02, 0.02};
    const Dataset equal = test::exposed(photographs, nearly_equal);
    const Dataset held_out = test::exposed(test::sphereDataset(Split::test, 4, 100), {});
    const auto score = [&](const Dataset& dataset, ExposureMode mode) {
        TrainOptions options;
        options.steps = {700};
        options.bounds = Box{Vec3d::Constant(-1), Vec3d::Constant(1)};
        options.exposure = mode;
        Report silent;
        const TrainResult result = train(dataset, options, silent, {});
        CHECK(result.gains.size() == (mode == ExposureMode::off ? 0 : 24));
        return evaluate(result.model, held_out, {}, silent).psnr;
    };
    const double off = score(varied, ExposureMode::off), on = score(varied, ExposureMode::on);
    const double best = score(equal, ExposureMode::off);
    CAPTURE(off, on, best);
    CHECK(on > off + 4);
    CHECK(on > best - 0.5);
}

TEST_CASE("exposures do not depend on threads, and are in the checkpoint") {
    const TempDir dir;
    Report silent;
    const TrainResult whole = train(variedSphere(), shortRun(ExposureMode::on), silent, {}, dir / "whole.ckpt");
    const std::string expected = modelBytes(whole, dir);
    REQUIRE(whole.gains.size() == 12);
    // That anything was learned: the gains of this capture go from 0.7 to 1.4.
    const auto [low, high] = std::minmax_element(whole.gains.begin(), whole.gains.end());
    CHECK(*high - *low > 0.1);

    for (const int stop : {1, 60}) {
        const ThreadLimit limit(1);
        StopAfter report(stop);
        train(variedSphere(), shortRun(ExposureMode::on), report, {}, dir / "parts.ckpt");
        const TrainResult parts = train(variedSphere(), shortRun(ExposureMode::off), silent, {}, dir / "parts.ckpt", true);
        CHECK(parts.gains == whole.gains);
        CHECK(modelBytes(parts, dir) == expected);
        CHECK(readFile(dir / "parts.ckpt") == readFile(dir / "whole.ckpt"));
    }
}

TEST_CASE("left to itself, training takes photographs as equal that differ less from their neighbours than from others") {
    // Around the sphere the gain rises by half and falls again; the same gains in another order.
    constexpr int kViews = 40;
    std::vector<Camera> cameras;
    std::vector<std::array<double, 6>> drift(kViews), mixed(kViews);
    for (int v = 0; v < kViews; ++v) {
        const double angle = 2 * std::numbers::pi * v / kViews, gain = 1 + 0.25 * std::sin(angle);
        cameras.push_back(lookAt(4.03 * Vec3d(std::cos(angle), std::sin(angle), 0.1), Vec3d::Zero(), Vec3d::UnitZ(), 0.69, 48, 48));
        drift[v] = {gain, gain, gain, 0, 0, 0};
    }
    for (int v = 0; v < kViews; ++v) mixed[v] = drift[v * 17 % kViews];
    const Dataset circle = test::sphereDataset(cameras);
    const auto gains = [&](const std::vector<std::array<double, 6>>& exposures) {
        TrainOptions options = shortRun(ExposureMode::automatic);
        options.steps = {200, 1};  // the first stage decides
        Report silent;
        return train(test::exposed(circle, exposures), options, silent, {}).gains.size();
    };
    CHECK(gains(drift) == 0);
    CHECK(gains(mixed) == kViews);
}

TEST_CASE("left to itself, training learns exposures where they differ and photographs have no alpha") {
    const Dataset with_alpha = test::sphereDataset(Split::train, 12, 48);
    const Dataset equal = test::exposed(with_alpha, {});
    TrainOptions options = shortRun(ExposureMode::automatic);
    options.steps = {200, 1};  // the first stage decides
    const auto gains = [&](const Dataset& dataset, int stop) {
        StopAfter report(stop);
        return train(dataset, options, report, {}).gains.size();
    };
    CHECK(gains(variedSphere(), 1000) == 12);
    CHECK(gains(equal, 100) == 12);  // undecided yet
    CHECK(gains(equal, 1000) == 0);
    CHECK(gains(with_alpha, 100) == 0);
    options.exposure = ExposureMode::on;
    CHECK(gains(equal, 1000) == 12);
    CHECK(gains(with_alpha, 1000) == 12);
}
