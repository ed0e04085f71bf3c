// SPDX-License-Identifier: Apache-2.0
#include "bench/repeat.h"

#include <algorithm>
#include <cmath>

#include "bench/stopwatch.h"
#include "core/error.h"

namespace nerfvdb {
namespace {

constexpr double kConfidence = 0.95;

/// P(Binomial(n, 1/2) < k).
double binomialBelow(int n, int k) {
    double sum = 0;
    for (int i = 0; i < k; ++i)
        sum += std::exp(std::lgamma(n + 1.0) - std::lgamma(i + 1.0) - std::lgamma(n - i + 1.0) -
                        n * std::log(2.0));
    return sum;
}

}  // namespace

Summary summarize(std::span<const double> values) {
    Summary summary;
    summary.n = static_cast<int>(values.size());
    if (values.empty()) return summary;
    std::vector<double> sorted(values.begin(), values.end());
    std::sort(sorted.begin(), sorted.end());
    const int n = summary.n;
    summary.median = n % 2 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);

    int k = 1;
    while (2 * (k + 1) <= n && 1 - 2 * binomialBelow(n, k + 1) >= kConfidence) ++k;
    summary.low = sorted[k - 1];
    summary.high = sorted[n - k];
    summary.confidence = n == 1 ? 0 : 1 - 2 * binomialBelow(n, k);
    return summary;
}

std::vector<Timing> timeInTurn(std::span<const std::function<void()>> bodies, const RepeatOptions& options,
                               const std::string& stage, Report& report) {
    const int n_bodies = static_cast<int>(bodies.size());
    const auto goOn = [&](int done) {
        if (report.cancelled()) throw Interrupted("the measurement was stopped, as asked");
        report.update(done, "");
    };
    report.begin(stage, static_cast<std::int64_t>(n_bodies) * (options.repeats + options.warm_up));
    int done = 0;
    if (options.warm_up)
        for (const auto& body : bodies) {
            goOn(done++);
            body();
        }

    std::vector<Timing> timings(bodies.size());
    for (int repeat = 0; repeat < options.repeats; ++repeat)
        for (int b = 0; b < n_bodies; ++b) {
            goOn(done++);
            Stopwatch watch;
            int calls = 0;
            watch.start();
            do {
                bodies[b]();
                ++calls;
            } while (watch.wallSeconds() < options.min_sample_s || calls % options.calls != 0);
            watch.pause();
            timings[b].wall_s.push_back(watch.wallSeconds() / calls);
            timings[b].cpu_s.push_back(watch.cpuSeconds() / calls);
        }
    report.end();
    return timings;
}

}  // namespace nerfvdb
