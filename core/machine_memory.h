// SPDX-License-Identifier: Apache-2.0
// How much memory a program may hope for.
#pragma once

#include <cstddef>

namespace nerfvdb {

/// Bytes of memory that this machine has, or that its container (a control group, version 2) allows, whichever is less.
std::size_t machineMemory();

}  // namespace nerfvdb
