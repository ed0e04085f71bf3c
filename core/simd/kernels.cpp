// SPDX-License-Identifier: Apache-2.0
// The inner loops in portable vectors (Highway), compiled once per instruction set and dispatched at run time.
// kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "core/simd/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, kPadding>;
using IntTag = hn::RebindToSigned<FloatTag>;
using FloatVec = hn::Vec<FloatTag>;
using IntVec = hn::Vec<IntTag>;
constexpr FloatTag kFloat;
constexpr IntTag kInt;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloat));

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
            std::int32_t leaf_coord[3];
            for (int axis = 0; axis < 3; ++axis) {
                std::int32_t c = static_cast<std::int32_t>(o[axis] + d[axis] * t) >> 3;
                c = c < 0 ? 0 : c;
                leaf_coord[axis] = c < bricks.table_dims[axis] ? c : bricks.table_dims[axis] - 1;
            }
            const std::int32_t leaf =
                bricks.skip_table[(static_cast<std::size_t>(leaf_coord[0]) * bricks.table_dims[1] + leaf_coord[1]) *
                                      bricks.table_dims[2] + leaf_coord[2]];

            // The cube to cross: this leaf, or all the empty leaves around it.
            const std::int32_t reach = leaf < 0 ? -leaf : 1;
            float t_exit = length;
            for (int axis = 0; axis < 3; ++axis) {
                const float lo = static_cast<float>((leaf_coord[axis] - reach + 1) * 8);
                const float hi = static_cast<float>((leaf_coord[axis] + reach) * 8);
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

void densityForward(const Bricks& bricks, int n, const SampleArrays& samples, float max_raw, float tau_scale,
                    float* raw, float* tau, float* alpha, float* decay) {
    padSamples(samples, n);
    // Below exp(-87) the result is zero in single precision; above it expm1's own series is exact.
    const FloatVec most = hn::Set(kFloat, 87.0f);
    for (int i = 0; i < n; i += kLanes) {
        Corners corners;
        loadCorners(bricks, samples, i, corners);
        FloatVec sum = hn::Mul(corners.weight[0], hn::GatherIndex(kFloat, bricks.density, corners.index[0]));
        for (int corner = 1; corner < 8; ++corner)
            sum = hn::MulAdd(corners.weight[corner], hn::GatherIndex(kFloat, bricks.density, corners.index[corner]),
                             sum);
        const FloatVec depth =
            hn::Mul(hn::Exp(kFloat, hn::Min(sum, hn::Set(kFloat, max_raw))), hn::Set(kFloat, tau_scale));
        const FloatVec negative = hn::Neg(hn::Min(depth, most));
        const auto is_opaque = hn::Gt(depth, most);
        hn::StoreU(sum, kFloat, raw + i);
        hn::StoreU(depth, kFloat, tau + i);
        hn::StoreU(hn::Neg(hn::Expm1(kFloat, negative)), kFloat, alpha + i);
        hn::StoreU(hn::IfThenZeroElse(is_opaque, hn::Exp(kFloat, negative)), kFloat, decay + i);
    }
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

template <int kChannels>
void accumulateLeafOf(int n, const LeafContribution* contributions, const LeafGradient& gradient) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    for (int i = 0; i < n; ++i) {
        const LeafContribution& sample = contributions[i];
        const float weight_x[2] = {1 - sample.fx, sample.fx};
        const float weight_y[2] = {1 - sample.fy, sample.fy};
        const float weight_z[2] = {1 - sample.fz, sample.fz};
        for (int corner = 0; corner < 8; ++corner) {
            const std::int32_t x = sample.x + (corner >> 2), y = sample.y + (corner >> 1 & 1),
                               z = sample.z + (corner & 1);
            if ((x | y | z) & ~7) continue;  // negative or above 7: another leaf's voxel
            const int voxel = x * 64 + y * 8 + z;
            const float corner_weight = weight_x[corner >> 2] * weight_y[corner >> 1 & 1] * weight_z[corner & 1];
            gradient.density[voxel] += corner_weight * sample.dl_draw;
            gradient.touched[x] |= std::uint64_t{1} << (y * 8 + z);
            const auto scale = hn::Set(row, corner_weight * sample.weight);
            float* const out = gradient.features + voxel * kChannels;
            for (int c = 0; c < kChannels; c += kRowLanes)
                hn::StoreU(hn::MulAdd(scale, hn::LoadU(row, sample.dl_dfeatures + c), hn::LoadU(row, out + c)), row,
                           out + c);
        }
    }
}

void accumulateLeaf(int n, const LeafContribution* contributions, int channels, const LeafGradient& gradient) {
    switch (channels) {
        case 4: return accumulateLeafOf<4>(n, contributions, gradient);
        case 8: return accumulateLeafOf<8>(n, contributions, gradient);
        default: return accumulateLeafOf<16>(n, contributions, gradient);
    }
}

/// Which face neighbours of the voxels of one word are active, and in the leaf: bits as the voxels', in the order
/// x - 1, x + 1, y - 1, y + 1, z - 1, z + 1.
struct FaceNeighbours {
    static constexpr int kOffsets[6] = {-64, 64, -8, 8, -1, 1};
    std::uint64_t exists[6];

    FaceNeighbours(const std::uint64_t* active, int word) {
        constexpr std::uint64_t kFirstZ = 0x0101010101010101ull;
        const std::uint64_t self = active[word];
        exists[0] = word > 0 ? active[word - 1] : 0;
        exists[1] = word < 7 ? active[word + 1] : 0;
        exists[2] = self << 8;
        exists[3] = self >> 8;
        exists[4] = (self & ~(kFirstZ << 7)) << 1;
        exists[5] = (self & ~kFirstZ) >> 1;
    }
};

/// The face neighbours of one voxel. Without branches: no processor foresees which exist.
struct Around {
    int voxel[6];     // an absent one is the voxel itself, times 0
    float weight[6];
    float share;      // 1 / their number
    float any;        // 1 if there are some, else 0

    Around(const FaceNeighbours& neighbours, int center) {
        constexpr float kShare[7] = {0, 1.0f, 1.0f / 2, 1.0f / 3, 1.0f / 4, 1.0f / 5, 1.0f / 6};
        int n = 0;
        for (int i = 0; i < 6; ++i) {
            const int exists = static_cast<int>(neighbours.exists[i] >> (center & 63) & 1);
            voxel[i] = center + (FaceNeighbours::kOffsets[i] & -exists);
            weight[i] = static_cast<float>(exists);
            n += exists;
        }
        share = kShare[n];
        any = n > 0 ? 1.0f : 0.0f;
    }
};

/// Asks for all that an update will read, at once: one after the other each voxel would wait for memory.
template <int kChannels>
HWY_INLINE void prefetchLeaf(const std::uint64_t* active, const std::uint64_t* touched, const float* density,
                             const float* density_moment, const float* features, const float* feature_moment) {
    for (int word = 0; word < 8; ++word) {
        // A voxel is read if it is touched or the neighbour of one that is; being neighbours is mutual.
        const FaceNeighbours near(touched, word);
        std::uint64_t read = touched[word];
        for (std::uint64_t bits = read; bits; bits &= bits - 1) {
            const int voxel = word * 64 + __builtin_ctzll(bits);
            for (const float* const values : {density_moment, feature_moment}) __builtin_prefetch(values + voxel);
        }
        for (const std::uint64_t bits : near.exists) read |= bits & active[word];
        for (; read; read &= read - 1) {
            const int voxel = word * 64 + __builtin_ctzll(read);
            __builtin_prefetch(density + voxel);
            __builtin_prefetch(features + voxel * kChannels);
        }
    }
}

/// How far a voxel's density stands above the mean of its neighbours', at most 1 either way.
HWY_INLINE float roughness(const Around& around, float value, const float* density) {
    float sum = 0;
    for (int i = 0; i < 6; ++i) sum += around.weight[i] * density[around.voxel[i]];
    const float above = around.any * (value - sum * around.share);
    return above > 1 ? 1 : above < -1 ? -1 : above;
}

/// Pulls row `voxel` of a leaf's features by `pull` towards the mean of its neighbours.
template <int kChannels>
HWY_INLINE void smoothRow(const Around& around, int voxel, float pull, float* features) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    const auto share = hn::Set(row, around.share), strength = hn::Set(row, around.any * pull);
    for (int c = 0; c < kChannels; c += kRowLanes) {
        auto sum = hn::Zero(row);
        for (int i = 0; i < 6; ++i)
            sum = hn::MulAdd(hn::Set(row, around.weight[i]),
                             hn::LoadU(row, features + around.voxel[i] * kChannels + c), sum);
        float* const values = features + voxel * kChannels + c;
        const auto value = hn::LoadU(row, values);
        hn::StoreU(hn::MulAdd(strength, hn::MulSub(sum, share, value), value), row, values);
    }
}

template <int kChannels>
void rmsPropLeafOf(const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                   float* density, float* density_moment, float* features, float* feature_moment) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    constexpr int kRowVectors = kChannels / kRowLanes;
    const float keep = rates.decay, add = 1 - rates.decay;
    prefetchLeaf<kChannels>(active, gradient.touched, density, density_moment, features, feature_moment);
    for (int word = 0; word < 8; ++word) {
        if (gradient.touched[word] == 0) continue;
        const FaceNeighbours neighbours(active, word);
        for (std::uint64_t bits = gradient.touched[word]; bits; bits &= bits - 1) {
            const int voxel = word * 64 + __builtin_ctzll(bits);
            const float g = gradient.density[voxel];
            gradient.density[voxel] = 0;
            density_moment[voxel] = keep * density_moment[voxel] + add * g * g;
            const Around around(neighbours, voxel);
            density[voxel] -= rates.density_rate *
                              (g / (__builtin_sqrtf(density_moment[voxel]) + rates.epsilon) + rates.sparsity +
                               rates.density_smoothing * roughness(around, density[voxel], density));

            float* const gradients = gradient.features + voxel * kChannels;
            float* const values = features + voxel * kChannels;
            auto squares = hn::Zero(row);
            for (int v = 0; v < kRowVectors; ++v) {
                const auto gf = hn::LoadU(row, gradients + v * kRowLanes);
                squares = hn::MulAdd(gf, gf, squares);
            }
            const float mean_square = hn::GetLane(hn::SumOfLanes(row, squares)) * (1.0f / kChannels);
            feature_moment[voxel] = keep * feature_moment[voxel] + add * mean_square;
            const auto scale =
                hn::Set(row, rates.feature_rate / (__builtin_sqrtf(feature_moment[voxel]) + rates.epsilon));
            if (rates.feature_smoothing > 0)
                smoothRow<kChannels>(around, voxel, rates.feature_rate * rates.feature_smoothing, features);
            for (int v = 0; v < kRowVectors; ++v) {
                const auto gf = hn::LoadU(row, gradients + v * kRowLanes);
                hn::StoreU(hn::NegMulAdd(scale, gf, hn::LoadU(row, values + v * kRowLanes)), row,
                           values + v * kRowLanes);
                hn::StoreU(hn::Zero(row), row, gradients + v * kRowLanes);
            }
        }
        gradient.touched[word] = 0;
    }
}

void rmsPropLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                 float* density, float* density_moment, float* features, float* feature_moment) {
    switch (channels) {
        case 4:
            return rmsPropLeafOf<4>(rates, active, gradient, density, density_moment, features, feature_moment);
        case 8:
            return rmsPropLeafOf<8>(rates, active, gradient, density, density_moment, features, feature_moment);
        default:
            return rmsPropLeafOf<16>(rates, active, gradient, density, density_moment, features, feature_moment);
    }
}

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

const char* activeTarget() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(marchRays);
HWY_EXPORT(densityForward);
HWY_EXPORT(featuresForward);
HWY_EXPORT(rowDots);
HWY_EXPORT(accumulateLeaf);
HWY_EXPORT(rmsPropLeaf);
HWY_EXPORT(layerForward);
HWY_EXPORT(layerBackwardInput);
HWY_EXPORT(layerBackwardWeights);
HWY_EXPORT(activeTarget);
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
void featuresForward(const Bricks& bricks, int n, const SampleArrays& samples, const std::int32_t* ray,
                     const float* weight, float* features, float* ray_features) {
    HWY_DYNAMIC_DISPATCH(featuresForward)(bricks, n, samples, ray, weight, features, ray_features);
}
void rowDots(int n, int channels, const float* features, const std::int32_t* ray, const float* ray_features,
             float* out) {
    HWY_DYNAMIC_DISPATCH(rowDots)(n, channels, features, ray, ray_features, out);
}
void accumulateLeaf(int n, const LeafContribution* contributions, int channels, const LeafGradient& gradient) {
    HWY_DYNAMIC_DISPATCH(accumulateLeaf)(n, contributions, channels, gradient);
}
void rmsPropLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                 float* density, float* density_moment, float* features, float* feature_moment) {
    HWY_DYNAMIC_DISPATCH(rmsPropLeaf)
    (channels, rates, active, gradient, density, density_moment, features, feature_moment);
}
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
const char* activeTarget() { return HWY_DYNAMIC_DISPATCH(activeTarget)(); }

namespace {

/// Fixed before anything can be forced: Highway forgets the others then.
const std::vector<std::int64_t>& allTargets() {
    static const std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
    return targets;
}

}  // namespace

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
#endif  // HWY_ONCE
