// SPDX-License-Identifier: Apache-2.0
// Training steps that change nothing: a trained model learns on with all rates zero, so that every step does the
// full work of a step and leaves the next one the same values.
#pragma once

#include "trainer/train_step.h"
#include "vdb/model.h"

namespace nerfvdb {

/// One step after another on copies of a model's values.
class TrainingProbe {
public:
    /// Keeps references to the data set and, through the ray source, to nothing else.
    TrainingProbe(const Model& model, const Dataset& dataset, float min_alpha = 0);

    /// One step of `batch` rays, other ones each time, so that what they need is not in the cache already; the n-th step of
    /// any two probes draws the same, if the same pixels can be drawn.
    StepReport step(int batch, const TraceOptions& trace = {});

    TrainState& state() { return state_; }
    RaySource& source() { return source_; }

private:
    TrainState state_;
    RaySource source_;
    TrainStepper stepper_;
    std::uint64_t n_steps_ = 0;
};

}  // namespace nerfvdb
