// SPDX-License-Identifier: Apache-2.0
// What becomes of a step that meets NaN, infinity, or gradients too large to square: nothing has moved, it
// counts, and other rays are tried at lower rates. Three in a row are no accident.
#pragma once

#include <cstdint>
#include <string>

#include "trainer/dataset.h"
#include "trainer/train_step.h"

namespace nerfvdb {

class StepGuard {
public:
    static constexpr int kAttempts = 3;
    static constexpr float kRateFactor = 0.25f;  // from an attempt to the next

    /// As TrainStepper::step. If nothing moved because of what the step met, tries again, with other rays and a
    /// quarter of the rates; the report of the last attempt. Same state, seed and step: same outcome.
    StepReport step(TrainStepper& stepper, TrainState& state, const RaySource& source, std::uint64_t step,
                    int batch, const StepRates& rates, const TraceOptions& trace);

    /// Attempts that moved nothing, in all.
    std::uint64_t undone() const { return undone_; }

    /// One sentence about a step whose attempts all failed: step, image, pixel, and how to look at that ray.
    static std::string complaint(const StepReport& report, std::int64_t step, const Dataset& dataset);

private:
    std::uint64_t undone_ = 0;
};

}  // namespace nerfvdb
