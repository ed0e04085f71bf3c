// SPDX-License-Identifier: Apache-2.0
// Which instruction set the kernels run on.
#include <hwy/targets.h>

#include "core/simd/kernels.h"

namespace nerfvdb::simd {
namespace {

/// Fixed before anything can be forced: Highway forgets the others then.
const std::vector<std::int64_t>& allTargets() {
    static const std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
    return targets;
}

}  // namespace

const char* activeTarget() { return hwy::TargetName(hwy::SupportedAndGeneratedTargets().front()); }

std::vector<std::string> supportedTargets() {
    std::vector<std::string> names;
    for (const std::int64_t target : allTargets()) names.emplace_back(hwy::TargetName(target));
    return names;
}

bool forceTarget(const std::string& name) {
    std::int64_t forced = 0;  // all
    for (const std::int64_t target : allTargets())
        if (name == hwy::TargetName(target)) forced = target;
    if (forced == 0 && !name.empty()) return false;
    hwy::SetSupportedTargetsForTest(forced);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    return true;
}

}  // namespace nerfvdb::simd
