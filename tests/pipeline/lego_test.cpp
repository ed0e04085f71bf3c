// SPDX-License-Identifier: Apache-2.0
// A few steps on a real data set, where it is at hand: enough to see that learning works, too few for fine
// detail.
#include "tests/support/catch.h"
#include "tests/support/data.h"
#include "trainer/evaluate.h"
#include "trainer/trainer.h"

using namespace nerfvdb;

TEST_CASE("300 steps on lego reach a stated quality on held-out views", "[slow]") {
    const std::filesystem::path lego = testing::dataPath("nerf_synthetic/lego");
    NERFVDB_NEEDS(lego);
    Report silent;
    TrainOptions options;
    options.steps = {300};
    const TrainResult result = train(readDataset(lego, Split::train, {}, silent), options, silent, {});
    CHECK(result.steps == 300);

    EvaluateOptions every_50th;
    every_50th.every = 50;
    const Evaluation evaluation =
        evaluate(result.model, readDataset(lego, Split::test, {}, silent), every_50th, silent);
    REQUIRE(evaluation.views.size() == 4);
    CHECK(evaluation.psnr > 23.1);  // dB; measured 24.1, less one for other instruction sets and small changes
}
