// SPDX-License-Identifier: Apache-2.0
// Training steps that can be repeated: a trained model learns on with all rates zero, so that every step does
// the full work of a step and none changes what the next one sees.
#pragma once

#include "trainer/train_step.h"
#include "vdb/model.h"

namespace nerfvdb {

/// One step after another on copies of a model's values.
class TrainingProbe {
public:
    /// Keeps references to the data set and, through the ray source, to nothing else.
    TrainingProbe(const Model& model, const Dataset& dataset, float min_alpha = 0);

    /// One step of `batch` rays, the same rays each time.
    StepReport step(int batch, const TraceOptions& trace = {});

    TrainState& state() { return state_; }
    RaySource& source() { return source_; }

private:
    TrainState state_;
    RaySource source_;
    TrainStepper stepper_;
};

}  // namespace nerfvdb
