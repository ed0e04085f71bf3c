// SPDX-License-Identifier: Apache-2.0
// In leaves: gathering gradients, and the optimiser, in portable vectors (Highway), compiled once per instruction
// set and dispatched at run time. kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/leaf_kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/highway.h>

#include "core/simd/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

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

}  // namespace
}  // namespace nerfvdb::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nerfvdb {
HWY_EXPORT(accumulateLeaf);
HWY_EXPORT(rmsPropLeaf);
}  // namespace nerfvdb

namespace nerfvdb::simd {

void accumulateLeaf(int n, const LeafContribution* contributions, int channels, const LeafGradient& gradient) {
    HWY_DYNAMIC_DISPATCH(accumulateLeaf)(n, contributions, channels, gradient);
}
void rmsPropLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                 float* density, float* density_moment, float* features, float* feature_moment) {
    HWY_DYNAMIC_DISPATCH(rmsPropLeaf)
    (channels, rates, active, gradient, density, density_moment, features, feature_moment);
}

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
