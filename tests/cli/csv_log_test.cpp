// SPDX-License-Identifier: Apache-2.0
#include "cli/csv_log.h"

#include <vector>

#include "core/atomic_file.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;
namespace fs = std::filesystem;

namespace {

const std::string kHead = "step,seconds,loss,psnr,rays,voxels,distortion,entropy,alpha_error\n";

TrainProgress progressOf(std::int64_t step, double seconds, bool has_checkpoint) {
    TrainProgress progress;
    progress.step = step;
    progress.seconds = seconds;
    progress.loss = 0.25;
    progress.psnr = 6.0206;
    progress.rays = 1000;
    progress.voxels = 8;
    progress.distortion = 0.5;
    progress.alpha_error = 0.125;
    progress.has_checkpoint = has_checkpoint;
    return progress;
}

class Warnings : public Report {
public:
    void warn(const std::string& line) override { lines.push_back(line); }
    std::vector<std::string> lines;
};

}  // namespace

TEST_CASE("a run that fails before its first checkpoint leaves the log of the run before it", "[cli]") {
    const TempDir dir;
    const fs::path path = dir / "model.csv";
    writeAtomically(path, "of the run before");
    Report silent;
    {
        CsvLog log(path, /*resume=*/false, silent);
        log.add(progressOf(10, 2, false));
        CHECK(readFile(path) == "of the run before");
        CHECK(readFile(dir / "model.csv.part") == kHead + "10,2.00,0.25,6.021,1000,8,0.5,0,0.125\n");  // to be looked at
    }
    CHECK(readFile(path) == "of the run before");
    CHECK_FALSE(fs::exists(dir / "model.csv.part"));
}

TEST_CASE("a log takes its name with the checkpoint, and with the model at the latest", "[cli]") {
    const TempDir dir;
    const fs::path path = dir / "model.csv";
    writeAtomically(path, "of the run before");
    Report silent;
    CsvLog log(path, /*resume=*/false, silent);
    log.add(progressOf(10, 2, false));
    SECTION("checkpoint") { log.add(progressOf(20, 4, true)); }
    SECTION("model") {
        log.add(progressOf(20, 4, false));
        log.finish();
    }
    CHECK(readFile(path) == kHead + "10,2.00,0.25,6.021,1000,8,0.5,0,0.125\n20,4.00,0.25,6.021,1000,8,0.5,0,0.125\n");
    CHECK_FALSE(fs::exists(dir / "model.csv.part"));
}

TEST_CASE("a resumed run continues the rows and the seconds of its log", "[cli]") {
    const TempDir dir;
    const fs::path path = dir / "model.csv";
    writeAtomically(path, kHead + "10,2.00,0.25,6,1,8,0.5,0.25,0\n20,4.50,0.25,6,1,8,0.5,0.25,0\n30,7.00,0.25,6,1,8,0.5,0.25,0\n");
    Report silent;
    CsvLog log(path, /*resume=*/true, silent);
    log.add(progressOf(25, 1, true));  // the checkpoint was made before step 25; row 30 came to nothing
    log.add(progressOf(35, 3, true));
    CHECK(readFile(path) == kHead + "10,2.00,0.25,6,1,8,0.5,0.25,0\n20,4.50,0.25,6,1,8,0.5,0.25,0\n" +
                                "25,5.50,0.25,6.021,1000,8,0.5,0,0.125\n35,7.50,0.25,6.021,1000,8,0.5,0,0.125\n");
}

TEST_CASE("a resumed run with nothing left to do keeps its log", "[cli]") {
    const TempDir dir;
    writeAtomically(dir / "model.csv", kHead + "10,2.00,0.25,6,1,8,0.5,0.25,0\n");
    Report silent;
    CsvLog(dir / "model.csv", /*resume=*/true, silent).finish();
    CHECK(readFile(dir / "model.csv") == kHead + "10,2.00,0.25,6,1,8,0.5,0.25,0\n");
}

TEST_CASE("a log that cannot be written is one warning", "[cli]") {
    const TempDir dir;
    fs::create_directories(dir / "model.csv.part" / "in the way");
    Warnings report;
    CsvLog log(dir / "model.csv", /*resume=*/false, report);
    for (int step = 1; step <= 3; ++step) log.add(progressOf(step, 1, false));
    REQUIRE(report.lines.size() == 1);
    CHECK_THAT(report.lines[0],
               Catch::StartsWith("log not written, training goes on: ") && Catch::Contains("model.csv.part"));
    log.finish();  // there is room again, and nothing was lost
    CHECK(readFile(dir / "model.csv").substr(kHead.size(), 2) == "1,");
}
