// SPDX-License-Identifier: Apache-2.0
// Which losses a training takes beside the error of colours: that depends on whether photographs have alpha.
#include "tests/support/catch.h"
#include "tests/support/sphere_dataset.h"
#include "trainer/trainer.h"

using namespace nerfvdb;

namespace {

/// The last row of the log of a short training.
TrainProgress lastRow(const Dataset& dataset) {
    TrainOptions options;
    options.steps = {5};
    options.bounds = Box{{-0.9, -0.9, -0.9}, {0.9, 0.9, 0.9}};
    Report silent;
    TrainProgress last;
    train(dataset, options, silent, [&](const TrainProgress& progress) { last = progress; });
    return last;
}

}  // namespace

TEST_CASE("photographs with alpha teach opacity by it, others by its entropy") {
    Dataset dataset = test::surroundedSphereDataset(8, 24);
    const TrainProgress with = lastRow(dataset);
    CHECK(with.alpha_error > 0);
    CHECK(with.entropy == 0);
    CHECK(with.distortion > 0);

    for (View& view : dataset.views)
        for (Photo::Pixel& pixel : view.photo.pixels) pixel[3] = 255;
    dataset.has_alpha = false;
    const TrainProgress without = lastRow(dataset);
    CHECK(without.alpha_error == 0);
    CHECK(without.entropy > 0);
}
