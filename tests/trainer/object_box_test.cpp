// SPDX-License-Identifier: Apache-2.0
#include "trainer/object_box.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/error.h"
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/evaluate.h"
#include "trainer/scene_box.h"
#include "trainer/trainer.h"

namespace nerfvdb {
namespace {

constexpr double kRadius = 0.8;  // of the ball that `synth sphere` shows

/// The same photographs, laid on a colour.
Dataset laidOn(Dataset dataset, const std::array<int, 3>& colour) {
    dataset.has_alpha = false;
    for (View& view : dataset.views) {
        view.photo.has_alpha = false;
        for (Photo::Pixel& pixel : view.photo.pixels) {
            for (int c = 0; c < 3; ++c)
                pixel[c] = static_cast<std::uint8_t>(std::lround((pixel[c] * pixel[3] + colour[c] * (255 - pixel[3])) / 255.0));
            pixel[3] = 255;
        }
    }
    return dataset;
}

}  // namespace

TEST_CASE("an object before a plain background is found, and learned without fog around it") {
    for (const std::array<int, 3>& colour : {std::array{255, 255, 255}, std::array{0, 0, 0}, std::array{60, 120, 90}}) {
        CAPTURE(colour[0], colour[1], colour[2]);
        const Dataset dataset = laidOn(test::surroundedSphereDataset(24, 64), colour);
        const Box around = findCommonView(dataset);
        CHECK(around.size().minCoeff() > 3.2 * kRadius);
        TrainOptions options;
        options.steps = {600};
        Report silent;
        const Box box = findObject(dataset, around, options, silent);
        CHECK(box.min.maxCoeff() <= -kRadius);
        CHECK(box.max.minCoeff() >= kRadius);
        CHECK(box.size().maxCoeff() < 2 * 1.4 * kRadius);  // a margin of one cell, 0.08 of the radius, and what is half in one

        const Model model = train(dataset, options, silent, {}).model;
        CHECK(model.sky.isEmpty());
        for (int c = 0; c < 3; ++c) CHECK(255 * model.background[c] == Approx(colour[c]).margin(1));
        CHECK(model.field.frame().origin.minCoeff() > -1.4 * kRadius);
        CHECK(boundsOfCells(model.field.frame(), model.field.topology()).size().maxCoeff() < 2 * 1.3 * kRadius);
        const Dataset held_out = laidOn(test::sphereDataset(Split::test, 4, 64), colour);
        CHECK(evaluate(model, held_out, {}, silent).psnr > 30);
    }
}

TEST_CASE("where there is no object, the box stays as it is") {
    Dataset dataset = test::surroundedSphereDataset(12, 32);
    for (View& view : dataset.views) std::fill(view.photo.pixels.begin(), view.photo.pixels.end(), Photo::Pixel{0, 0, 0, 0});
    dataset = laidOn(std::move(dataset), {200, 210, 220});
    const Box around = findCommonView(dataset);
    Report silent;
    const Box box = findObject(dataset, around, {}, silent);
    CHECK(box.min == around.min);
    CHECK(box.max == around.max);
}

TEST_CASE("whoever asks for an open scene, or gives its bounds, has no object looked for") {
    const Dataset dataset = laidOn(test::surroundedSphereDataset(12, 32), {255, 255, 255});
    Report silent;
    TrainOptions open;
    open.steps = {10};
    open.extent = SceneExtent::open;
    CHECK_FALSE(train(dataset, open, silent, {}).model.sky.isEmpty());
    TrainOptions bounded;
    bounded.steps = {10};
    bounded.bounds = Box{Vec3d::Constant(-1.5), Vec3d::Constant(1.5)};
    CHECK(train(dataset, bounded, silent, {}).model.field.frame().voxel_size == Approx(3.0 / 63));
}

TEST_CASE("a search that is stopped leaves no model") {
    struct Stopped : Report {
        bool cancelled() const override { return true; }
    } stopped;
    TrainOptions options;
    options.steps = {10};
    CHECK_THROWS_AS(train(laidOn(test::surroundedSphereDataset(12, 32), {0, 0, 0}), options, stopped, {}), Interrupted);
}

}  // namespace nerfvdb
