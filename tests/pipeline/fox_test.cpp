// SPDX-License-Identifier: Apache-2.0
// A walk around a fox, photographed by hand, without bounds: a floor for what is learned of a real place. Photographs of a
// quarter of their size and 1500 steps, for time; whole photographs and ten minutes are in docs/quality.md.
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "trainer/evaluate.h"
#include "trainer/trainer.h"

using namespace nerfvdb;

TEST_CASE("1500 steps on a quarter of fox reach a stated quality on held-out views", "[slow]") {
    const std::filesystem::path fox = testing::dataPath("fox");
    NERFVDB_NEEDS(fox);
    Report silent;
    DatasetOptions quarter;
    quarter.downscale = 4;
    TrainOptions options;
    options.steps = {1500};
    const TrainResult result = train(readDataset(fox, Split::train, quarter, silent), options, silent, {});
    CHECK(result.model.field.shells().count > 1);
    CHECK_FALSE(result.model.sky.isEmpty());

    const Evaluation evaluation = evaluate(result.model, readDataset(fox, Split::test, quarter, silent), {}, silent);
    REQUIRE(evaluation.views.size() == 7);
    CHECK(evaluation.psnr > 22.9);  // dB; measured 23.9, less one for other instruction sets and small changes
    for (const ViewScore& view : evaluation.views) CHECK(view.psnr > 18);  // measured 19.5 and more
    // A scene without bounds is skipped through, too: a dense march would read features a thousand times a ray.
    CHECK(evaluation.counters.samples_features < 0.1 * static_cast<double>(evaluation.counters.samples_dense));
}
