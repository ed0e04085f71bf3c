// SPDX-License-Identifier: Apache-2.0
// The same test on every instruction set that this machine runs.
#pragma once

#include <string>

#include "core/simd/kernels.h"
#include "tests/support/catch.h"

namespace nerfvdb::test {

/// Calls body() with each target forced in turn, and leaves that active which was.
template <typename Body>
void forEachTarget(const Body& body) {
    const simd::KeepTarget keep;
    for (const std::string& target : simd::supportedTargets()) {
        CAPTURE(target);
        REQUIRE(simd::forceTarget(target));
        body();
    }
}

}  // namespace nerfvdb::test
