// SPDX-License-Identifier: Apache-2.0
// Multiply-adds in registers and nothing else, compiled once per instruction set: the floor that the other kernels are
// measured against.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/yardstick_kernel.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/highway.h>

#include "core/simd/kernels.h"
#include "core/simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

double multiplyAdds(int rounds, float start, float* end) {
    constexpr int kRegisters = 12;  // two units with a latency of four to six, and sixteen registers in all
    const FloatVec half = hn::Set(kFloat, 0.5f);
    FloatVec x[kRegisters];
    for (FloatVec& value : x) value = hn::Set(kFloat, start);
    for (int round = 0; round < rounds; ++round)
        for (FloatVec& value : x) value = hn::MulAdd(value, half, half);
    FloatVec sum = hn::Zero(kFloat);
    for (const FloatVec& value : x) sum = hn::Add(sum, value);
    for (int i = 0; i < kPadding; ++i) end[i] = 0;
    hn::StoreU(sum, kFloat, end);
    return 2.0 * rounds * kRegisters * kLanes;
}

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(multiplyAdds);
}  // namespace nerfvdb

namespace nerfvdb::simd {

double multiplyAdds(int rounds, float start, float* end) { return HWY_DYNAMIC_DISPATCH(multiplyAdds)(rounds, start, end); }

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
