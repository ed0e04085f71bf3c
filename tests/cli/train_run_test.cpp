// SPDX-License-Identifier: Apache-2.0
#include "cli/train_run.h"

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;
using Catch::Contains;

TEST_CASE("what kept a training from being whole is said after its files are written, the worst first", "[cli]") {
    TrainOutcome outcome;
    CHECK(outcome.isWhole());
    CHECK_NOTHROW(throwUnlessWhole(outcome, "a.vdb", "--resume"));

    outcome.stopped = "stopped at step 7 of 9; ";
    CHECK_FALSE(outcome.isWhole());
    CHECK_THROWS_AS(throwUnlessWhole(outcome, "a.vdb", "--resume"), Interrupted);
    CHECK_THROWS_WITH(throwUnlessWhole(outcome, "a.vdb", "--resume"), "stopped at step 7 of 9; saved a.vdb; --resume goes on");

    outcome.checkpoint_error = "a.ckpt: found no room";
    CHECK_THROWS_AS(throwUnlessWhole(outcome, "a.vdb", "--resume"), IoError);
    CHECK_THROWS_WITH(throwUnlessWhole(outcome, "a.vdb", "--resume"),
                      Contains("saved a.vdb, but not its checkpoint") && Contains("a.ckpt: found no room"));

    outcome.numeric_error = "training: found a value that is not finite";
    CHECK_FALSE(outcome.isWhole());
    CHECK_THROWS_AS(throwUnlessWhole(outcome, "a.vdb", "--resume"), NumericError);
    CHECK_THROWS_WITH(throwUnlessWhole(outcome, "a.vdb", "--resume"),
                      Contains("not finite") && Contains("saved what was learned before as a.vdb"));
}
