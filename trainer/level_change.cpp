// SPDX-License-Identifier: Apache-2.0
#include "trainer/level_change.h"

#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

/// Calls carry(old values, new values) for both moments, one after the other; the field is the new one already.
template <typename Carry>
void carryMoments(TrainState& state, const Carry& carry) {
    for (HugeArray<float>* const moment : {&state.density_moment, &state.feature_moment}) {
        HugeArray<float> fine(state.field.density().size());
        carry(moment->span(), fine.span());
        *moment = std::move(fine);
    }
    state.seen.assign(state.field.topology().leafCount(), {});
}

}  // namespace

void refineState(TrainState& state, Topology fine) {
    const Topology coarse = state.field.topology();
    state.field = refineField(std::move(state.field), std::move(fine));
    carryMoments(state, [&](std::span<const float> from, std::span<float> to) {
        refineValues(coarse, state.field.topology(), 1, from, to);
    });
}

void halveState(TrainState& state, Topology halved, const Shells& shells) {
    const Topology before = state.field.topology();
    const Shells shells_before = state.field.shells();
    const Topology seen = halveRegions(prune(before, state.seen), shells_before, shells);
    state.field = halveField(std::move(state.field), std::move(halved), shells);
    const Topology& topology = state.field.topology();
    carryMoments(state, [&](std::span<const float> from, std::span<float> to) {
        halveValues(before, shells_before, topology, 1, from, to);
    });
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (const int n = seen.findLeaf(topology.leafCoords()[leaf]); n >= 0) state.seen[leaf] = seen.cells()[n];
}

}  // namespace nerfvdb
