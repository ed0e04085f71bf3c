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

/// to[0..3] += sums of the lanes of four vectors, side by side: a transpose costs half of four sums.
HWY_INLINE void addSumsOfLanes(const FloatVec* from, float* to) {
#if HWY_TARGET == HWY_SCALAR
    for (int q = 0; q < kRows; ++q) to[q] += hn::GetLane(from[q]);
#else
    // Per block of four lanes: a0 + a2, b0 + b2, a1 + a3, b1 + b3; then the sums of a, b, c, d.
    const FloatVec ab = hn::Add(hn::InterleaveLower(kFloat, from[0], from[1]),
                                hn::InterleaveUpper(kFloat, from[0], from[1]));
    const FloatVec cd = hn::Add(hn::InterleaveLower(kFloat, from[2], from[3]),
                                hn::InterleaveUpper(kFloat, from[2], from[3]));
    const hn::Repartition<double, FloatTag> pairs;
    const auto ab_pairs = hn::BitCast(pairs, ab), cd_pairs = hn::BitCast(pairs, cd);
    const FloatVec sums = hn::Add(hn::BitCast(kFloat, hn::InterleaveLower(pairs, ab_pairs, cd_pairs)),
                                  hn::BitCast(kFloat, hn::InterleaveUpper(pairs, ab_pairs, cd_pairs)));
    HWY_ALIGN float blocks[kLanes];
    hn::Store(sums, kFloat, blocks);
    const hn::CappedTag<float, kRows> row;
    auto total = hn::LoadU(row, to);
    for (int block = 0; block < kLanes; block += kRows) total = hn::Add(total, hn::Load(row, blocks + block));
    hn::StoreU(total, row, to);
#endif
}

/// dl_dweights of a block of kRows x kRows: rows o.. of dl_dout against rows i.. of in.
HWY_INLINE void backwardWeightsBlock(int padded, int stride, int n_in, int rows, int columns, const float* dl_dout,
                                     const float* in, float* dl_dweights) {
    FloatVec sum[kRows][kRows];
    for (int p = 0; p < kRows; ++p)
        for (int q = 0; q < kRows; ++q) sum[p][q] = hn::Zero(kFloat);
    for (int b = 0; b < padded; b += kLanes) {
        FloatVec value[kRows];
        for (int q = 0; q < kRows; ++q) value[q] = hn::LoadU(kFloat, in + (q < columns ? q : 0) * stride + b);
        for (int p = 0; p < kRows; ++p) {
            const FloatVec slope = hn::LoadU(kFloat, dl_dout + (p < rows ? p : 0) * stride + b);
            for (int q = 0; q < kRows; ++q) sum[p][q] = hn::MulAdd(slope, value[q], sum[p][q]);
        }
    }
    for (int p = 0; p < rows; ++p) {
        float* const to = dl_dweights + p * n_in;
        if (columns == kRows) {
            addSumsOfLanes(sum[p], to);
            continue;
        }
        for (int q = 0; q < columns; ++q) to[q] += hn::GetLane(hn::SumOfLanes(kFloat, sum[p][q]));
    }
}

void layerBackwardWeights(int n, int stride, int n_in, int n_out, const float* dl_dout, const float* in,
                          float* dl_dweights, float* dl_dbias) {
    constexpr int kPanel = 4 * kRows;  // rows of dl_dout that stay in the first-level cache while `in` streams by
    const int padded = (n + kPadding - 1) / kPadding * kPadding;
    for (int panel = 0; panel < n_out; panel += kPanel) {
        const int end = panel + kPanel < n_out ? panel + kPanel : n_out;
        for (int i = 0; i < n_in; i += kRows)
            for (int o = panel; o < end; o += kRows)
                backwardWeightsBlock(padded, stride, n_in, end - o < kRows ? end - o : kRows,
                                     n_in - i < kRows ? n_in - i : kRows, dl_dout + o * stride, in + i * stride,
                                     dl_dweights + o * n_in + i);
        for (int o = panel; o < end; ++o) {
            FloatVec sum = hn::Zero(kFloat);
            for (int b = 0; b < padded; b += kLanes) sum = hn::Add(sum, hn::LoadU(kFloat, dl_dout + o * stride + b));
            dl_dbias[o] += hn::GetLane(hn::SumOfLanes(kFloat, sum));
        }
    }
}

void adamStep(int n, const AdamRates& rates, const float* gradients, float* first, float* second, float* parameters) {
    const FloatVec beta1 = hn::Set(kFloat, rates.beta1), rest1 = hn::Set(kFloat, 1 - rates.beta1);
    const FloatVec beta2 = hn::Set(kFloat, rates.beta2), rest2 = hn::Set(kFloat, 1 - rates.beta2);
    const FloatVec rate = hn::Set(kFloat, rates.rate * rates.scale1), scale2 = hn::Set(kFloat, rates.scale2);
    const FloatVec epsilon = hn::Set(kFloat, rates.epsilon);
    int i = 0;
    for (; i + kLanes <= n; i += kLanes) {
        const FloatVec g = hn::LoadU(kFloat, gradients + i);
        const FloatVec m = hn::MulAdd(beta1, hn::LoadU(kFloat, first + i), hn::Mul(rest1, g));
        const FloatVec v = hn::MulAdd(beta2, hn::LoadU(kFloat, second + i), hn::Mul(rest2, hn::Mul(g, g)));
        const FloatVec step = hn::Div(hn::Mul(rate, m), hn::Add(hn::Sqrt(hn::Mul(scale2, v)), epsilon));
        hn::StoreU(m, kFloat, first + i);
        hn::StoreU(v, kFloat, second + i);
        hn::StoreU(hn::Sub(hn::LoadU(kFloat, parameters + i), step), kFloat, parameters + i);
    }
    reference::adamStep(n - i, rates, gradients + i, first + i, second + i, parameters + i);
}

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(layerForward);
HWY_EXPORT(layerBackwardInput);
HWY_EXPORT(layerBackwardWeights);
HWY_EXPORT(adamStep);
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

void adamStep(int n, const AdamRates& rates, const float* gradients, float* first, float* second, float* parameters) {
    HWY_DYNAMIC_DISPATCH(adamStep)(n, rates, gradients, first, second, parameters);
}

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
