// SPDX-License-Identifier: Apache-2.0
#include "bench/repeat.h"

#include <cmath>
#include <thread>

#include "core/error.h"
#include "tests/support/catch.h"

using namespace nerfvdb;

TEST_CASE("median and interval of values worked out by hand") {
    SECTION("an odd number") {
        const std::vector<double> values = {5, 1, 9, 3, 7};
        const Summary summary = summarize(values);
        CHECK(summary.n == 5);
        CHECK(summary.median == 5);
        // Five values cannot give 95 %: the whole range, 1 - 2 / 2^5.
        CHECK(summary.low == 1);
        CHECK(summary.high == 9);
        CHECK(summary.confidence == Approx(0.9375));
    }
    SECTION("an even number") {
        const std::vector<double> values = {4, 1, 3, 2};
        CHECK(summarize(values).median == 2.5);
        CHECK(summarize(values).confidence == Approx(0.875));
    }
    SECTION("eight values leave the range alone, nine give up their ends") {
        // 1 - 2 P(Bin(8, 1/2) < 2) = 1 - 2 * 9 / 256 = 0.930; 1 - 2 P(Bin(9, 1/2) < 2) = 1 - 2 * 10 / 512 =
        // 0.961.
        const std::vector<double> eight = {1, 2, 3, 4, 5, 6, 7, 8}, nine = {1, 2, 3, 4, 5, 6, 7, 8, 9};
        CHECK(summarize(eight).low == 1);
        CHECK(summarize(eight).high == 8);
        CHECK(summarize(nine).low == 2);
        CHECK(summarize(nine).high == 8);
        CHECK(summarize(nine).confidence == Approx(1 - 20.0 / 512));
    }
    SECTION("twenty values: the sixth and the fifteenth") {
        // Conover's table for n = 20, 95 %: x_(6) and x_(15), 1 - 2 * 0.0207.
        std::vector<double> values;
        for (int i = 20; i >= 1; --i) values.push_back(i);
        const Summary summary = summarize(values);
        CHECK(summary.median == 10.5);
        CHECK(summary.low == 6);
        CHECK(summary.high == 15);
        CHECK(summary.confidence == Approx(0.9586).margin(1e-4));
    }
    SECTION("one value says nothing about noise; none says nothing at all") {
        const std::vector<double> one = {3};
        CHECK(summarize(one).median == 3);
        CHECK(summarize(one).low == 3);
        CHECK(summarize(one).high == 3);
        CHECK(summarize(one).confidence == 0);
        CHECK(summarize({}).n == 0);
    }
    SECTION("the interval holds the true median as often as it says") {
        // 400 samples of 11 numbers from a triangle-shaped distribution; its confidence is 98.8 %.
        int hits = 0;
        std::uint64_t state = 1;
        const auto uniform = [&] {
            state = state * 6364136223846793005ull + 1442695040888963407ull;
            return static_cast<double>(state >> 33) * 0x1p-31;
        };
        const double true_median = std::sqrt(0.5);  // of the larger of two uniform numbers
        for (int sample = 0; sample < 400; ++sample) {
            std::vector<double> values(11);
            for (double& value : values) value = std::max(uniform(), uniform());
            const Summary summary = summarize(values);
            CHECK(summary.confidence == Approx(0.9883).margin(1e-3));
            hits += summary.low <= true_median && true_median <= summary.high;
        }
        CHECK(hits >= 385);  // 395 expected, standard deviation 2.2
    }
}

TEST_CASE("bodies are timed in turn, as often as asked, after one call that does not count") {
    std::string order;
    const std::function<void()> bodies[] = {[&] { order += 'a'; }, [&] { order += 'b'; }};
    Report silent;
    const std::vector<Timing> timings = timeInTurn(bodies, {.repeats = 3}, "test", silent);
    CHECK(order == "abababab");
    REQUIRE(timings.size() == 2);
    CHECK(timings[0].wall_s.size() == 3);
    CHECK(timings[1].cpu_s.size() == 3);
}

TEST_CASE("a short body is called until its sample is long enough; times are per call") {
    int calls = 0;
    const std::function<void()> bodies[] = {[&] {
        ++calls;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }};
    Report silent;
    const std::vector<Timing> timings =
        timeInTurn(bodies, {.repeats = 2, .min_sample_s = 0.02, .warm_up = false}, "test", silent);
    CHECK(calls >= 4);   // at least two a sample, on a machine that oversleeps fivefold
    CHECK(calls <= 22);  // a sleep is never shorter than asked: eleven a sample
    for (const double seconds : timings[0].wall_s) CHECK(seconds >= 0.002);
    for (const double seconds : timings[0].cpu_s) CHECK(seconds < 0.002);  // it slept
}

TEST_CASE("measuring stops when the report is cancelled") {
    struct Cancelled : Report {
        bool cancelled() const override { return true; }
    } report;
    int calls = 0;
    const std::function<void()> bodies[] = {[&] { ++calls; }};
    CHECK_THROWS_AS(timeInTurn(bodies, {}, "test", report), Interrupted);
    CHECK(calls == 0);
}
