// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nerfvdb {

/// Sends for the cache line at p, without waiting; p may be any address. The empty statement is for GCC, to which a
/// function or a loop of nothing but __builtin_prefetch does nothing, and is left out.
inline void prefetch(const void* p) {
    __builtin_prefetch(p);
    __asm__ volatile("");
}

}  // namespace nerfvdb
