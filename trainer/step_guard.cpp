// SPDX-License-Identifier: Apache-2.0
#include "trainer/step_guard.h"

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
    const std::string view = std::to_string(report.bad_view), x = std::to_string(report.bad_x),
                      y = std::to_string(report.bad_y);
    return "training: NaN, infinity or a gradient too large " + std::to_string(kAttempts) +
           " times in a row at step " + std::to_string(step) + ", image " +
           dataset.views[static_cast<std::size_t>(report.bad_view)].path.string() + ", pixel (" + x + ", " + y +
           "); look at that ray with nerfvdb eval MODEL.vdb DATA --split train --debug-ray " + view + ":" + x +
           ":" + y;
}

}  // namespace nerfvdb
