// SPDX-License-Identifier: Apache-2.0
// The suite in small: every row was tried and kept; the bound of skipping is not only kept but nearly reached.
#include "bench/stress.h"

#include <cmath>

#include "bench/stress_decoder.h"
#include "bench/stress_kernels.h"
#include "bench/stress_rays.h"
#include "bench/error_curves.h"
#include "bench/stress_skips.h"
#include "bench/stress_training.h"
#include "core/simd/kernels.h"
#include "tests/support/catch.h"
#include "tests/support/temp_dir.h"

using namespace nerfvdb;

namespace {

void checkAll(const std::vector<StressRow>& rows) {
    REQUIRE(!rows.empty());
    for (const StressRow& row : rows) {
        CAPTURE(row.area, row.name, row.cases, row.failed, row.worst, row.bound, row.worst_case, row.reason);
        CHECK(row.passed());
    }
}

}  // namespace

TEST_CASE("rays of every awkward kind keep their bounds") {
    Report silent;
    checkAll(stressRays({.every = 31}, silent));
}

TEST_CASE(
    "the decoder and the kernels of every instruction set keep their bounds, and the best set is active "
    "again") {
    Report silent;
    checkAll(stressDecoder(silent));
    checkAll(stressKernels(silent));
    CHECK(simd::activeTarget() == simd::supportedTargets().front());
}

TEST_CASE("skipping costs no more than is proved, and hostile scenes come near it") {
    Report silent;
    const std::vector<StressRow> rows = stressSkips({.scenes = 10}, silent);
    checkAll(rows);
    for (const StressRow& row : rows) {
        CAPTURE(row.name);
        if (row.name.find("dropped") == 0) CHECK(row.worst > 0.85 * row.bound);
        if (row.name.find("the defaults of") == 0) CHECK(row.worst > 0.75 * row.bound);
    }
}

TEST_CASE("quadrature on a hard surface is of second order, and thresholds cost within their bounds") {
    Report silent;
    const BenchResult curves = errorCurves({.rays = 100, .repeats = 1, .min_sample_s = 0}, silent);
    double order = 0;
    for (const auto& [name, value] : curves.figures)
        if (name == "ball: order from step 0.25 to 0.125") order = value;
    CHECK(order >
          1.7);  // measured 1.97 with 200 rays; kinks at voxels' faces leave a little of the first order
    std::size_t n_bounded = 0;
    for (const BenchRow& row : curves.rows) {
        const double bound = curves.median(row, "bound"), error = curves.median(row, "largest_error");
        if (std::isnan(bound)) continue;
        CAPTURE(row.series, row.label);
        CHECK(error <= bound + 1e-2);  // roundings of 143 samples
        ++n_bounded;
    }
    CHECK(n_bounded == 38);
}

TEST_CASE(
    "values that are not finite are refused where they enter, and hard input ends in a model or a sentence") {
    const TempDir dir;
    Report silent;
    checkAll(stressInput(dir.path(), 3, silent));
}

TEST_CASE("training gives the same bytes on any number of threads, and survives rates ten times too high") {
    Report silent;
    checkAll(stressDeterminism(silent));
}
