// SPDX-License-Identifier: Apache-2.0
// Measuring more than once: how often, in which order, and what may be concluded from the numbers.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/report.h"

namespace nerfvdb {

/// What repeats of one measurement say.
struct Summary {
    int n = 0;
    double median = 0;         // the mean of the two middle values when n is even
    double low = 0, high = 0;  // two of the values, between which the true median lies ...
    double confidence = 0;     // ... with this probability, whatever the distribution
};

/// Median and the narrowest symmetric interval of order statistics that covers the true median with at least 95
/// %: P(x_(k) <= median <= x_(n+1-k)) = 1 - 2 P(Binomial(n, 1/2) < k). Below six values none does, and the
/// interval is the whole range with the confidence that it has. No values: all zero. Source: the sign test;
/// Conover 1999, "Practical nonparametric statistics", section 3.2.
Summary summarize(std::span<const double> values);

/// Seconds of one call, an entry per repeat.
struct Timing {
    std::vector<double> wall_s, cpu_s;
};

struct RepeatOptions {
    int repeats = 5;
    double min_sample_s = 0;  // a repeat calls the body until this much time is over, and takes the mean ...
    int calls = 1;            // ... of a multiple of so many calls
    bool warm_up = true;      // call each body once before anything is timed
};

/// Times several bodies in turn, one repeat of each after the other, so that a machine that slows down for a
/// while slows all of them. `stage` names the work to the report. Throws Interrupted when the report is
/// cancelled.
std::vector<Timing> timeInTurn(std::span<const std::function<void()>> bodies, const RepeatOptions& options,
                               const std::string& stage, Report& report);

}  // namespace nerfvdb
