// SPDX-License-Identifier: Apache-2.0
// The network's layers, forward and backward, in portable vectors (Highway), compiled once per instruction
// set and dispatched at run time. kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/network_kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/highway.h>

#include "core/simd/kernels.h"
#include "core/simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

// The network's products, as blocks of kRows x kColumns registers: four rows of weights against a few vectors of
// samples, so that each load serves several multiplications.
constexpr int kRows = 4;
constexpr int kColumns = kLanes == 16 ? 4 : 2;

template <int kVectors>
HWY_INLINE void forwardBlock(int stride, int n_in, int rows, const float* weights, const float* bias, bool relu,
                             const float* in, float* out) {
    FloatVec sum[kRows][kVectors];
    for (int o = 0; o < kRows; ++o)
        for (int v = 0; v < kVectors; ++v) sum[o][v] = hn::Set(kFloat, o < rows ? bias[o] : 0.0f);
    const float* row[kRows];
    for (int o = 0; o < kRows; ++o) row[o] = weights + (o < rows ? o : 0) * n_in;
    for (int i = 0; i < n_in; ++i) {
        FloatVec value[kVectors];
        for (int v = 0; v < kVectors; ++v) value[v] = hn::LoadU(kFloat, in + i * stride + v * kLanes);
        for (int o = 0; o < kRows; ++o) {
            const FloatVec weight = hn::Set(kFloat, row[o][i]);
            for (int v = 0; v < kVectors; ++v) sum[o][v] = hn::MulAdd(weight, value[v], sum[o][v]);
        }
    }
    for (int o = 0; o < rows; ++o)
        for (int v = 0; v < kVectors; ++v)
            hn::StoreU(relu ? hn::Max(sum[o][v], hn::Zero(kFloat)) : sum[o][v], kFloat,
                       out + o * stride + v * kLanes);
}

void layerForward(int n, int stride, int n_in, int n_out, const float* weights, const float* bias, bool relu,
                  const float* in, float* out) {
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int b = 0; b < padded;) {
        const bool wide = b + kColumns * kLanes <= padded;
        for (int o = 0; o < n_out; o += kRows) {
            const int rows = n_out - o < kRows ? n_out - o : kRows;
            if (wide)
                forwardBlock<kColumns>(stride, n_in, rows, weights + o * n_in, bias + o, relu, in + b,
                                       out + o * stride + b);
            else
                forwardBlock<1>(stride, n_in, rows, weights + o * n_in, bias + o, relu, in + b,
                                out + o * stride + b);
        }
        b += wide ? kColumns * kLanes : kLanes;
    }
}

template <int kVectors>
HWY_INLINE void backwardInputBlock(int stride, int n_in, int n_out, int rows, const float* weights,
                                   const float* dl_dout, const float* relu_of, float* dl_din) {
    FloatVec sum[kRows][kVectors];
    for (int i = 0; i < kRows; ++i)
        for (int v = 0; v < kVectors; ++v) sum[i][v] = hn::Zero(kFloat);
    int column[kRows];
    for (int i = 0; i < kRows; ++i) column[i] = i < rows ? i : 0;
    for (int o = 0; o < n_out; ++o) {
        FloatVec value[kVectors];
        for (int v = 0; v < kVectors; ++v) value[v] = hn::LoadU(kFloat, dl_dout + o * stride + v * kLanes);
        for (int i = 0; i < kRows; ++i) {
            const FloatVec weight = hn::Set(kFloat, weights[o * n_in + column[i]]);
            for (int v = 0; v < kVectors; ++v) sum[i][v] = hn::MulAdd(weight, value[v], sum[i][v]);
        }
    }
    for (int i = 0; i < rows; ++i)
        for (int v = 0; v < kVectors; ++v) {
            FloatVec result = sum[i][v];
            if (relu_of)
                result = hn::IfThenElseZero(
                    hn::Gt(hn::LoadU(kFloat, relu_of + i * stride + v * kLanes), hn::Zero(kFloat)), result);
            hn::StoreU(result, kFloat, dl_din + i * stride + v * kLanes);
        }
}

void layerBackwardInput(int n, int stride, int n_in, int n_out, const float* weights, const float* dl_dout,
                        const float* relu_of, float* dl_din) {
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int b = 0; b < padded;) {
        const bool wide = b + kColumns * kLanes <= padded;
        for (int i = 0; i < n_in; i += kRows) {
            const int rows = n_in - i < kRows ? n_in - i : kRows;
            const float* const relu_rows = relu_of ? relu_of + i * stride + b : nullptr;
            if (wide)
                backwardInputBlock<kColumns>(stride, n_in, n_out, rows, weights + i, dl_dout + b, relu_rows,
                                             dl_din + i * stride + b);
            else
                backwardInputBlock<1>(stride, n_in, n_out, rows, weights + i, dl_dout + b, relu_rows,
                                      dl_din + i * stride + b);
        }
        b += wide ? kColumns * kLanes : kLanes;
    }
}

void layerBackwardWeights(int n, int stride, int n_in, int n_out, const float* dl_dout, const float* in,
                          float* dl_dweights, float* dl_dbias) {
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int o = 0; o < n_out; o += kRows) {
        const int rows = n_out - o < kRows ? n_out - o : kRows;
        for (int i = 0; i < n_in; i += kRows) {
            const int columns = n_in - i < kRows ? n_in - i : kRows;
            FloatVec sum[kRows][kRows];
            for (int p = 0; p < kRows; ++p)
                for (int q = 0; q < kRows; ++q) sum[p][q] = hn::Zero(kFloat);
            for (int b = 0; b < padded; b += kLanes) {
                FloatVec value[kRows];
                for (int q = 0; q < kRows; ++q)
                    value[q] = hn::LoadU(kFloat, in + (i + (q < columns ? q : 0)) * stride + b);
                for (int p = 0; p < kRows; ++p) {
                    const FloatVec slope = hn::LoadU(kFloat, dl_dout + (o + (p < rows ? p : 0)) * stride + b);
                    for (int q = 0; q < kRows; ++q) sum[p][q] = hn::MulAdd(slope, value[q], sum[p][q]);
                }
            }
            for (int p = 0; p < rows; ++p)
                for (int q = 0; q < columns; ++q)
                    dl_dweights[(o + p) * n_in + i + q] += hn::GetLane(hn::SumOfLanes(kFloat, sum[p][q]));
        }
        for (int p = 0; p < rows; ++p) {
            FloatVec sum = hn::Zero(kFloat);
            for (int b = 0; b < padded; b += kLanes)
                sum = hn::Add(sum, hn::LoadU(kFloat, dl_dout + (o + p) * stride + b));
            dl_dbias[o + p] += hn::GetLane(hn::SumOfLanes(kFloat, sum));
        }
    }
}

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(layerForward);
HWY_EXPORT(layerBackwardInput);
HWY_EXPORT(layerBackwardWeights);
}  // namespace nerfvdb

namespace nerfvdb::simd {

void layerForward(int n, int stride, int n_in, int n_out, const float* weights, const float* bias, bool relu,
                  const float* in, float* out) {
    HWY_DYNAMIC_DISPATCH(layerForward)(n, stride, n_in, n_out, weights, bias, relu, in, out);
}
void layerBackwardInput(int n, int stride, int n_in, int n_out, const float* weights, const float* dl_dout,
                        const float* relu_of, float* dl_din) {
    HWY_DYNAMIC_DISPATCH(layerBackwardInput)(n, stride, n_in, n_out, weights, dl_dout, relu_of, dl_din);
}
void layerBackwardWeights(int n, int stride, int n_in, int n_out, const float* dl_dout, const float* in,
                          float* dl_dweights, float* dl_dbias) {
    HWY_DYNAMIC_DISPATCH(layerBackwardWeights)(n, stride, n_in, n_out, dl_dout, in, dl_dweights, dl_dbias);
}

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
