// SPDX-License-Identifier: Apache-2.0
#include "trainer/step_guard.h"

#include <cstdio>

namespace nerfvdb {

StepReport StepGuard::step(TrainStepper& stepper, TrainState& state, const RaySource& source,
                           std::uint64_t step, int batch, const StepRates& rates, const TraceOptions& trace) {
    StepRates lowered = rates;
    StepReport report;
    for (std::uint64_t attempt = 0; attempt < kAttempts; ++attempt) {
        // Rays of steps that no training reaches, for each attempt its own.
        report = stepper.step(state, source, step + (attempt << 60), batch, lowered, trace);
        if (report.is_finite) break;
        ++undone_;
        for (float* rate : {&lowered.density, &lowered.features, &lowered.network, &lowered.sky, &lowered.exposure})
            *rate *= kRateFactor;
    }
    return report;
}

std::string StepGuard::complaint(const StepReport& report, std::int64_t step, const Dataset& dataset) {
    const StepReport::BadRay& bad = report.bad;
    const std::string view = std::to_string(bad.view), x = std::to_string(bad.x), y = std::to_string(bad.y);
    char jitter[32];
    std::snprintf(jitter, sizeof jitter, "%.9f", static_cast<double>(bad.jitter));  // drawn in steps of 2^-24
    return "training: NaN, infinity or a gradient too large " + std::to_string(kAttempts) +
           " times in a row at step " + std::to_string(step) + ", image " +
           dataset.views[static_cast<std::size_t>(bad.view)].path.string() + ", pixel (" + x + ", " + y +
           "); look at that ray with nerfvdb eval MODEL.vdb DATA --split train --debug-ray " + view + ":" + x +
           ":" + y + ":" + jitter;
}

}  // namespace nerfvdb
