// SPDX-License-Identifier: Apache-2.0
// Along rays: marching, and reading density and features, in portable vectors (Highway), compiled once per instruction
// set and dispatched at run time. kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/ray_kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "core/simd/kernels.h"
#include "core/simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

HWY_INLINE IntVec iota(std::int32_t first) { return hn::Iota(kInt, first); }

/// Distance along one axis to the far side of [lo, hi], for an origin o and 1 / direction.
HWY_INLINE float exitDistance(float lo, float hi, float o, float inverse) {
    return ((inverse >= 0 ? hi : lo) - o) * inverse;
}

/// 1 / d, or a huge number of the same sign where a ray runs along a face.
HWY_INLINE float safeInverse(float d) {
    constexpr float kSmallest = 1e-20f;
    if (d >= 0) return 1.0f / (d > kSmallest ? d : kSmallest);
    return 1.0f / (d < -kSmallest ? d : -kSmallest);
}

int marchRays(const Bricks& bricks, const RayTile& rays, float step, int max_per_ray, const std::int32_t* alive,
              int n_alive, std::int32_t* begin, const SampleArrays& out) {
    const float inverse_step = 1.0f / step;
    const FloatVec zero = hn::Zero(kFloat), one = hn::Set(kFloat, 1.0f), seven = hn::Set(kFloat, 7.0f);
    int n = 0;
    for (int a = 0; a < n_alive; ++a) {
        begin[a] = n;
        const int r = alive[a];
        const float o[3] = {rays.ox[r], rays.oy[r], rays.oz[r]};
        const float d[3] = {rays.dx[r], rays.dy[r], rays.dz[r]};
        const float inverse[3] = {safeInverse(d[0]), safeInverse(d[1]), safeInverse(d[2])};
        const float offset = rays.offset[r], length = rays.length[r];
        std::int32_t k = rays.next[r];
        while (k >= 0 && n - begin[a] < max_per_ray) {
            const float t = static_cast<float>(k) * step + offset;
            if (!(t < length)) {
                k = -1;
                break;
            }
            std::int32_t leaf_coord[3], node_coord[3];
            for (int axis = 0; axis < 3; ++axis) {
                std::int32_t c = static_cast<std::int32_t>(o[axis] + d[axis] * t) >> 3;
                c = c < 0 ? 0 : c;
                leaf_coord[axis] = c < bricks.leaf_dims[axis] ? c : bricks.leaf_dims[axis] - 1;
                node_coord[axis] = leaf_coord[axis] >> 3;
            }
            const std::int32_t node =
                bricks.skip_nodes[(static_cast<std::size_t>(node_coord[0]) * bricks.node_dims[1] + node_coord[1]) *
                                      bricks.node_dims[2] + node_coord[2]];
            const std::int32_t leaf =
                node < 0 ? node
                         : bricks.skip_leaves[static_cast<std::size_t>(node) * 512 + (leaf_coord[0] & 7) * 64 +
                                              (leaf_coord[1] & 7) * 8 + (leaf_coord[2] & 7)];

            // The cube to cross: this leaf, or all the empty leaves or nodes around it.
            const std::int32_t reach = leaf < 0 ? -leaf : 1;
            const std::int32_t* const place = node < 0 ? node_coord : leaf_coord;
            const std::int32_t edge = node < 0 ? 64 : 8;
            float t_exit = length;
            for (int axis = 0; axis < 3; ++axis) {
                const float lo = static_cast<float>((place[axis] - reach + 1) * edge);
                const float hi = static_cast<float>((place[axis] + reach) * edge);
                const float e = exitDistance(lo, hi, o[axis], inverse[axis]);
                t_exit = e < t_exit ? e : t_exit;
            }
            // The first sample at or beyond the exit; one step at least, whatever rounding says.
            const float k_float = (t_exit - offset) * inverse_step;
            std::int32_t k_exit = static_cast<std::int32_t>(k_float);
            k_exit += static_cast<float>(k_exit) < k_float;
            if (k_exit <= k) k_exit = k + 1;
            if (leaf < 0) {
                k = k_exit;
                continue;
            }

            const std::int32_t* bits = reinterpret_cast<const std::int32_t*>(bricks.occupied + std::size_t(leaf) * 8);
            const FloatVec lx = hn::Set(kFloat, o[0] - static_cast<float>(leaf_coord[0] * 8));
            const FloatVec ly = hn::Set(kFloat, o[1] - static_cast<float>(leaf_coord[1] * 8));
            const FloatVec lz = hn::Set(kFloat, o[2] - static_cast<float>(leaf_coord[2] * 8));
            const IntVec last = hn::Set(kInt, k_exit);
            for (; k < k_exit && n - begin[a] < max_per_ray; k += kLanes) {
                const IntVec ks = iota(k);
                const FloatVec ts =
                    hn::MulAdd(hn::ConvertTo(kFloat, ks), hn::Set(kFloat, step), hn::Set(kFloat, offset));
                const FloatVec px = hn::MulAdd(hn::Set(kFloat, d[0]), ts, lx);
                const FloatVec py = hn::MulAdd(hn::Set(kFloat, d[1]), ts, ly);
                const FloatVec pz = hn::MulAdd(hn::Set(kFloat, d[2]), ts, lz);
                const IntVec cx = hn::ConvertTo(kInt, hn::Min(hn::Max(px, zero), seven));
                const IntVec cy = hn::ConvertTo(kInt, hn::Min(hn::Max(py, zero), seven));
                const IntVec cz = hn::ConvertTo(kInt, hn::Min(hn::Max(pz, zero), seven));
                const IntVec word = hn::Or(hn::ShiftLeft<1>(cx), hn::ShiftRight<2>(cy));
                const IntVec bit = hn::Or(hn::ShiftLeft<3>(hn::And(cy, hn::Set(kInt, 3))), cz);
                const IntVec occupied =
                    hn::And(hn::GatherIndex(kInt, bits, word), hn::Shl(hn::Set(kInt, 1), bit));
                auto keep = hn::And(hn::Ne(occupied, hn::Zero(kInt)), hn::Lt(ks, last));
                if (hn::AllFalse(kInt, keep)) continue;
                const auto keep_float = hn::RebindMask(kFloat, keep);
                const auto fraction = [&](FloatVec p, IntVec c) HWY_ATTR {
                    return hn::Min(hn::Max(hn::Sub(p, hn::ConvertTo(kFloat, c)), zero), one);
                };
                const IntVec cell = hn::Or(hn::Or(hn::ShiftLeft<6>(cx), hn::ShiftLeft<3>(cy)), cz);
                hn::StoreU(hn::Set(kInt, leaf), kInt, out.leaf + n);
                hn::StoreU(hn::Compress(cell, keep), kInt, out.cell + n);
                hn::StoreU(hn::Compress(fraction(px, cx), keep_float), kFloat, out.x + n);
                hn::StoreU(hn::Compress(fraction(py, cy), keep_float), kFloat, out.y + n);
                hn::StoreU(hn::Compress(fraction(pz, cz), keep_float), kFloat, out.z + n);
                hn::StoreU(hn::Compress(ts, keep_float), kFloat, out.t + n);
                n += static_cast<int>(hn::CountTrue(kInt, keep));
            }
            if (k > k_exit) k = k_exit;
        }
        rays.next[r] = k;
    }
    begin[n_alive] = n;
    return n;
}

/// Value numbers and weights of the 8 corners of kLanes cells.
struct Corners {
    IntVec index[8];
    FloatVec weight[8];
};

HWY_INLINE void loadCorners(const Bricks& bricks, const SampleArrays& samples, int i, Corners& corners) {
    const IntVec leaf = hn::LoadU(kInt, samples.leaf + i);
    const IntVec cell = hn::LoadU(kInt, samples.cell + i);
    const IntVec seven = hn::Set(kInt, 7), one = hn::Set(kInt, 1), zero = hn::Zero(kInt);
    const IntVec x = hn::ShiftRight<6>(cell), y = hn::And(hn::ShiftRight<3>(cell), seven), z = hn::And(cell, seven);
    const IntVec x1 = hn::ShiftLeft<6>(hn::And(hn::Add(x, one), seven)), x0 = hn::ShiftLeft<6>(x);
    const IntVec y1 = hn::ShiftLeft<3>(hn::And(hn::Add(y, one), seven)), y0 = hn::ShiftLeft<3>(y);
    const IntVec z1 = hn::And(hn::Add(z, one), seven);
    const auto crosses_x = hn::Eq(x, seven), crosses_y = hn::Eq(y, seven), crosses_z = hn::Eq(z, seven);
    const IntVec base = hn::ShiftLeft<9>(leaf);
    if (hn::AllFalse(kInt, hn::Or(crosses_x, hn::Or(crosses_y, crosses_z)))) {
        for (int corner = 0; corner < 8; ++corner)
            corners.index[corner] = hn::Add(
                hn::Add(base, corner & 4 ? x1 : x0), hn::Add(corner & 2 ? y1 : y0, corner & 1 ? z1 : z));
    } else {
        const IntVec neighbours = hn::ShiftLeft<3>(leaf);
        const IntVec nx = hn::IfThenElse(crosses_x, hn::Set(kInt, 4), zero);
        const IntVec ny = hn::IfThenElse(crosses_y, hn::Set(kInt, 2), zero);
        const IntVec nz = hn::IfThenElse(crosses_z, one, zero);
        for (int corner = 0; corner < 8; ++corner) {
            IntVec owner = base;
            if (corner) {
                IntVec crossed = neighbours;
                if (corner & 4) crossed = hn::Add(crossed, nx);
                if (corner & 2) crossed = hn::Add(crossed, ny);
                if (corner & 1) crossed = hn::Add(crossed, nz);
                owner = hn::ShiftLeft<9>(hn::GatherIndex(kInt, bricks.upper_neighbours, crossed));
            }
            corners.index[corner] = hn::Add(
                hn::Add(owner, corner & 4 ? x1 : x0), hn::Add(corner & 2 ? y1 : y0, corner & 1 ? z1 : z));
        }
    }

    const FloatVec unit = hn::Set(kFloat, 1.0f);
    const FloatVec fx = hn::LoadU(kFloat, samples.x + i), fy = hn::LoadU(kFloat, samples.y + i),
                   fz = hn::LoadU(kFloat, samples.z + i);
    const FloatVec gx = hn::Sub(unit, fx), gy = hn::Sub(unit, fy), gz = hn::Sub(unit, fz);
    const FloatVec xy[4] = {hn::Mul(gx, gy), hn::Mul(gx, fy), hn::Mul(fx, gy), hn::Mul(fx, fy)};
    for (int corner = 0; corner < 8; ++corner)
        corners.weight[corner] = hn::Mul(xy[corner >> 1], corner & 1 ? fz : gz);
}

HWY_INLINE void padSamples(const SampleArrays& samples, int n) {
    for (int i = n; i < n + kPadding; ++i) samples.leaf[i] = samples.cell[i] = 0;
}

HWY_INLINE FloatVec trilinearDensity(const Bricks& bricks, const SampleArrays& samples, int i) {
    Corners corners;
    loadCorners(bricks, samples, i, corners);
    FloatVec sum = hn::Mul(corners.weight[0], hn::GatherIndex(kFloat, bricks.density, corners.index[0]));
    for (int corner = 1; corner < 8; ++corner)
        sum = hn::MulAdd(corners.weight[corner], hn::GatherIndex(kFloat, bricks.density, corners.index[corner]), sum);
    return sum;
}

/// What an optical depth does to light: alpha = 1 - exp(-depth), decay = exp(-depth).
HWY_INLINE void storeAbsorption(FloatVec depth, float* tau, float* alpha, float* decay) {
    // Below exp(-87) the result is zero in single precision; above it expm1's own series is exact.
    const FloatVec most = hn::Set(kFloat, 87.0f);
    const FloatVec negative = hn::Neg(hn::Min(depth, most));
    const auto is_opaque = hn::Gt(depth, most);
    hn::StoreU(depth, kFloat, tau);
    hn::StoreU(hn::Neg(hn::Expm1(kFloat, negative)), kFloat, alpha);
    hn::StoreU(hn::IfThenZeroElse(is_opaque, hn::Exp(kFloat, negative)), kFloat, decay);
}

void densityForward(const Bricks& bricks, int n, const SampleArrays& samples, float max_raw, float tau_scale,
                    float* raw, float* tau, float* alpha, float* decay) {
    padSamples(samples, n);
    for (int i = 0; i < n; i += kLanes) {
        const FloatVec value = trilinearDensity(bricks, samples, i);
        hn::StoreU(value, kFloat, raw + i);
        const FloatVec sigma = hn::Exp(kFloat, hn::Min(value, hn::Set(kFloat, max_raw)));
        storeAbsorption(hn::Mul(sigma, hn::Set(kFloat, tau_scale)), tau + i, alpha + i, decay + i);
    }
}

void sigmaForward(const Bricks& bricks, int n, const SampleArrays& samples, float tau_scale, float* tau, float* alpha,
                  float* decay) {
    padSamples(samples, n);
    for (int i = 0; i < n; i += kLanes)
        storeAbsorption(hn::Mul(trilinearDensity(bricks, samples, i), hn::Set(kFloat, tau_scale)), tau + i, alpha + i,
                        decay + i);
}

template <int kChannels>
void featuresForwardOf(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                       const float* weight, float* features, float* ray_features) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    constexpr int kBlock = 16;  // samples whose corners are known (and fetched) ahead of use
    HWY_ALIGN std::int32_t index[2][8][kBlock];
    HWY_ALIGN float corner_weight[2][8][kBlock];
    const auto prepare = [&](int i) HWY_ATTR {
        const int slot = i / kBlock & 1;
        for (int lane = 0; lane < kBlock; lane += kLanes) {
            Corners corners;
            loadCorners(bricks, samples, i + lane, corners);
            for (int corner = 0; corner < 8; ++corner) {
                hn::Store(corners.index[corner], kInt, &index[slot][corner][lane]);
                hn::Store(corners.weight[corner], kFloat, &corner_weight[slot][corner][lane]);
            }
        }
        for (int s = 0; s < kBlock; ++s)
            for (int corner = 0; corner < 8; ++corner)
                __builtin_prefetch(bricks.features + std::size_t(index[slot][corner][s]) * kChannels);
    };
    if (n > 0) prepare(0);
    for (int i = 0; i < n; i += kBlock) {
        if (i + kBlock < n) prepare(i + kBlock);
        const int slot = i / kBlock & 1;
        const int last = i + kBlock < n ? kBlock : n - i;
        for (int s = 0; s < last; ++s) {
            float* const out = features + std::size_t(i + s) * kChannels;
            float* const sum = ray_features + std::size_t(ray[i + s]) * kChannels;
            for (int c = 0; c < kChannels; c += kRowLanes) {
                auto value = hn::Zero(row);
                for (int corner = 0; corner < 8; ++corner)
                    value = hn::MulAdd(hn::Set(row, corner_weight[slot][corner][s]),
                                       hn::LoadU(row, bricks.features +
                                                          std::size_t(index[slot][corner][s]) * kChannels + c),
                                       value);
                hn::StoreU(value, row, out + c);
                hn::StoreU(hn::MulAdd(hn::Set(row, weight[i + s]), value, hn::LoadU(row, sum + c)), row, sum + c);
            }
        }
    }
}

void featuresForward(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                     const float* weight, float* features, float* ray_features) {
    padSamples(samples, n);
    switch (bricks.channels) {
        case 4: return featuresForwardOf<4>(bricks, n, samples, ray, weight, features, ray_features);
        case 8: return featuresForwardOf<8>(bricks, n, samples, ray, weight, features, ray_features);
        default: return featuresForwardOf<16>(bricks, n, samples, ray, weight, features, ray_features);
    }
}

template <int kChannels>
void rowDotsOf(int n, const float* features, const std::int32_t* ray, const float* ray_features, float* out) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    for (int i = 0; i < n; ++i) {
        const float* const a = features + std::size_t(i) * kChannels;
        const float* const b = ray_features + std::size_t(ray[i]) * kChannels;
        auto sum = hn::Mul(hn::LoadU(row, a), hn::LoadU(row, b));
        for (int c = kRowLanes; c < kChannels; c += kRowLanes)
            sum = hn::MulAdd(hn::LoadU(row, a + c), hn::LoadU(row, b + c), sum);
        out[i] = hn::GetLane(hn::SumOfLanes(row, sum));
    }
}

void rowDots(int n, int channels, const float* features, const std::int32_t* ray, const float* ray_features,
             float* out) {
    switch (channels) {
        case 4: return rowDotsOf<4>(n, features, ray, ray_features, out);
        case 8: return rowDotsOf<8>(n, features, ray, ray_features, out);
        default: return rowDotsOf<16>(n, features, ray, ray_features, out);
    }
}

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(marchRays);
HWY_EXPORT(densityForward);
HWY_EXPORT(sigmaForward);
HWY_EXPORT(featuresForward);
HWY_EXPORT(rowDots);
}  // namespace nerfvdb

namespace nerfvdb::simd {

int marchRays(const Bricks& bricks, const RayTile& rays, float step, int max_per_ray, const std::int32_t* alive,
              int n_alive, std::int32_t* begin, const SampleArrays& out) {
    return HWY_DYNAMIC_DISPATCH(marchRays)(bricks, rays, step, max_per_ray, alive, n_alive, begin, out);
}
void densityForward(const Bricks& bricks, int n, const SampleArrays& samples, float max_raw, float tau_scale,
                    float* raw, float* tau, float* alpha, float* decay) {
    HWY_DYNAMIC_DISPATCH(densityForward)(bricks, n, samples, max_raw, tau_scale, raw, tau, alpha, decay);
}
void sigmaForward(const Bricks& bricks, int n, const SampleArrays& samples, float tau_scale, float* tau, float* alpha,
                  float* decay) {
    HWY_DYNAMIC_DISPATCH(sigmaForward)(bricks, n, samples, tau_scale, tau, alpha, decay);
}
void featuresForward(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                     const float* weight, float* features, float* ray_features) {
    HWY_DYNAMIC_DISPATCH(featuresForward)(bricks, n, samples, ray, weight, features, ray_features);
}
void rowDots(int n, int channels, const float* features, const std::int32_t* ray, const float* ray_features,
             float* out) {
    HWY_DYNAMIC_DISPATCH(rowDots)(n, channels, features, ray, ray_features, out);
}

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
