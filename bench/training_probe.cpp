// SPDX-License-Identifier: Apache-2.0
#include "bench/training_probe.h"

#include "core/error.h"
#include "vdb/adapt.h"

namespace nerfvdb {

TrainingProbe::TrainingProbe(const Model& model, const Dataset& dataset, float min_alpha)
    : source_(dataset, 1) {
    state_.field = copyField(model.field, model.field.topology());
    state_.decoder = model.decoder;
    state_.background = model.background;
    state_.density_moment = HugeArray<float>(state_.field.density().size());
    state_.feature_moment = HugeArray<float>(state_.field.density().size());
    state_.seen.assign(state_.field.topology().leafCount(), {});
    state_.occupancy = findOccupied(state_.field, min_alpha);
    source_.update(state_.field, state_.occupancy);
    if (source_.tileCount() == 0)
        throw DataError(dataset.root.string(), "no view that shows the model",
                        "the data set that it was trained on");
}

StepReport TrainingProbe::step(int batch, const TraceOptions& trace) {
    const StepRates still{.density = 0, .features = 0, .network = 0};
    return stepper_.step(state_, source_, n_steps_++, batch, still, trace);
}

}  // namespace nerfvdb
