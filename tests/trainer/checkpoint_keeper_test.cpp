// SPDX-License-Identifier: Apache-2.0
#include "trainer/checkpoint_keeper.h"

#include <string>
#include <vector>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

namespace nerfvdb {
namespace {

class Warnings : public Report {
public:
    void warn(const std::string& line) override { lines.push_back(line); }
    std::vector<std::string> lines;
};

TrainState emptyState() {
    TrainState state;
    state.decoder = Decoder(8, 1, 16);
    return state;
}

}  // namespace

TEST_CASE("checkpoints are due after their interval, and never without a path") {
    const TempDir dir;
    Warnings report;
    REQUIRE(CheckpointKeeper(dir / "a.ckpt", 0, report).isDue());
    REQUIRE_FALSE(CheckpointKeeper(dir / "a.ckpt", 3600, report).isDue());
    CheckpointKeeper none({}, 0, report);
    REQUIRE_FALSE(none.isDue());
    none.saveNow(emptyState(), {});
    none.finish();
    REQUIRE_FALSE(none.hasFile());
    REQUIRE(report.lines.empty());
}

TEST_CASE("what the second thread writes and what training waits for are the same file") {
    const TempDir dir;
    Warnings report;
    CheckpointKeeper meanwhile(dir / "a.ckpt", 0, report), waiting(dir / "b.ckpt", 0, report);
    meanwhile.saveMeanwhile(emptyState(), {}, /*can_copy=*/true);
    meanwhile.finish();
    waiting.saveMeanwhile(emptyState(), {}, /*can_copy=*/false);
    REQUIRE(meanwhile.hasFile());
    REQUIRE(waiting.hasFile());
    REQUIRE(readFile(dir / "a.ckpt") == readFile(dir / "b.ckpt"));
    REQUIRE(waiting.count() == 1);
    REQUIRE(waiting.haltedSeconds() > 0);
    REQUIRE(report.lines.empty());
}

TEST_CASE("checkpoints that cannot be written are one warning, until one can") {
    const TempDir dir;
    Warnings report;
    CheckpointKeeper keeper(dir / "absent" / "a.ckpt", 0, report);
    for (const bool can_copy : {true, false, true}) {
        keeper.saveMeanwhile(emptyState(), {}, can_copy);
        keeper.finish();
    }
    REQUIRE_FALSE(keeper.hasFile());
    REQUIRE(report.lines.size() == 1);
    REQUIRE_THAT(report.lines[0], Catch::Contains("training goes on") && Catch::Contains("a.ckpt"));
    REQUIRE_THAT(keeper.error(), Catch::Contains("a.ckpt"));
    std::filesystem::create_directory(dir / "absent");
    keeper.saveNow(emptyState(), {});
    REQUIRE(keeper.hasFile());
    REQUIRE(keeper.error().empty());
}

}  // namespace nerfvdb
