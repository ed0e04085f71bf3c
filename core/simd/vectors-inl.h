// SPDX-License-Identifier: Apache-2.0
// Vectors of at most kPadding floats and as many integers, for the instruction set that is being compiled for.
// Included once for each of them, hence the guard of Highway's own -inl.h files in place of #pragma once.
#if defined(NERFVDB_VECTORS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef NERFVDB_VECTORS_INL_H
#undef NERFVDB_VECTORS_INL_H
#else
#define NERFVDB_VECTORS_INL_H
#endif

#include <hwy/highway.h>

#include "core/simd/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, kPadding>;
using IntTag = hn::RebindToSigned<FloatTag>;
using FloatVec = hn::Vec<FloatTag>;
using IntVec = hn::Vec<IntTag>;
constexpr FloatTag kFloat;
constexpr IntTag kInt;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloat));

}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per instruction set
