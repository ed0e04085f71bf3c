// SPDX-License-Identifier: Apache-2.0
// In leaves: gathering gradients, and the optimiser, in portable vectors (Highway), compiled once per instruction
// set and dispatched at run time. kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/leaf_kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/highway.h>

#include "core/prefetch.h"
#include "core/simd/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// The two corners of a cell along one axis, in one leaf. A corner in another leaf falls upon the one that lies in this
/// leaf, with nothing to add: a branch for it would be mispredicted at every third sample.
struct CornerPair {
    std::int32_t place[2];
    float share[2];

    explicit CornerPair(std::int32_t cell)
        : place{cell < 0 ? 0 : cell, cell < 7 ? cell + 1 : 7}, share{cell < 0 ? 0.0f : 1.0f, cell < 7 ? 1.0f : 0.0f} {}
};

template <int kChannels>
void accumulateLeafOf(int n, const LeafContribution* contributions, const LeafGradient& gradient) {
    constexpr int kAhead = 8;  // samples on their way from the cache below
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    for (int i = 0; i < n;) {
        const std::int32_t from = static_cast<std::int32_t>(contributions[i].corner);
        const std::int32_t cell = contributions[i].sample->cell;
        const float* const slope = contributions[i].sample->dl_dfeatures;
        // Samples of one ray in one cell, neighbours as the ray goes, are summed by its corners first.
        float density_sum[8] = {}, weight_sum[8] = {};
        do {
            prefetch(contributions[i + kAhead].sample);  // those behind n are another leaf's, which comes next
            const SampleGradient& sample = *contributions[i].sample;
            const float weight_x[2] = {1 - sample.x, sample.x}, weight_y[2] = {1 - sample.y, sample.y},
                        weight_z[2] = {1 - sample.z, sample.z};
            for (int corner = 0; corner < 8; ++corner) {
                const float weight = weight_x[corner >> 2] * weight_y[corner >> 1 & 1] * weight_z[corner & 1];
                density_sum[corner] += weight * sample.dl_draw;
                weight_sum[corner] += weight * sample.weight;
            }
            ++i;
        } while (i < n && contributions[i].sample->cell == cell && contributions[i].sample->dl_dfeatures == slope &&
                 static_cast<std::int32_t>(contributions[i].corner) == from);

        const CornerPair x((cell >> 6) - 2 * (from & 4)), y((cell >> 3 & 7) - 4 * (from & 2)),
            z((cell & 7) - 8 * (from & 1));
        const std::uint64_t z_bits = std::uint64_t{1} << z.place[0] | std::uint64_t{1} << z.place[1];
        const std::uint64_t bits = z_bits << (8 * y.place[0]) | z_bits << (8 * y.place[1]);
        gradient.touched[x.place[0]] |= bits;
        gradient.touched[x.place[1]] |= bits;
        for (int corner = 0; corner < 8; ++corner) {
            const int cx = corner >> 2, cy = corner >> 1 & 1, cz = corner & 1;
            const int voxel = x.place[cx] * 64 + y.place[cy] * 8 + z.place[cz];
            const float share = x.share[cx] * y.share[cy] * z.share[cz];
            gradient.density[voxel] += share * density_sum[corner];
            const auto scale = hn::Set(row, share * weight_sum[corner]);
            float* const out = gradient.features + voxel * kChannels;
            for (int c = 0; c < kChannels; c += kRowLanes)
                hn::StoreU(hn::MulAdd(scale, hn::LoadU(row, slope + c), hn::LoadU(row, out + c)), row, out + c);
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

constexpr int kLineFloats = 16;  // of a cache line

/// Asks for the cache lines of [64][stride] values of which those in `bits` will be read.
template <int kStride>
HWY_INLINE void prefetchWord(std::uint64_t bits, const float* values) {
    constexpr int kGroup = kStride < kLineFloats ? kLineFloats / kStride : 1;  // values in a line
    constexpr std::uint64_t kFirst = kGroup == 16 ? 0x0001000100010001ull
                                     : kGroup == 4 ? 0x1111111111111111ull
                                     : kGroup == 2 ? 0x5555555555555555ull : ~0ull;
    for (int half = 1; half < kGroup; half *= 2) bits |= bits >> half;
    for (bits &= kFirst; bits; bits &= bits - 1) prefetch(values + __builtin_ctzll(bits) * kStride);
}

template <int kChannels>
void prefetchLeafOf(bool smooths, const std::uint64_t* active, const std::uint64_t* touched, const float* density,
                    const float* density_moment, const float* features, const float* feature_moment) {
    for (int word = 0; word < 8; ++word) {
        std::uint64_t read = touched[word];
        if (smooths) {
            // A voxel is read if it is touched or the neighbour of one that is; being neighbours is mutual.
            const FaceNeighbours near(touched, word);
            for (const std::uint64_t bits : near.exists) read |= bits & active[word];
        }
        prefetchWord<1>(touched[word], density_moment + word * 64);
        prefetchWord<1>(touched[word], feature_moment + word * 64);
        prefetchWord<1>(read, density + word * 64);
        prefetchWord<kChannels>(read, features + word * 64 * kChannels);
    }
}

bool smooths(const RmsPropRates& rates) { return rates.density_smoothing > 0 || rates.feature_smoothing > 0; }

void prefetchLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                  const float* density, const float* density_moment, const float* features,
                  const float* feature_moment) {
    const auto of = channels == 4 ? prefetchLeafOf<4> : channels == 8 ? prefetchLeafOf<8> : prefetchLeafOf<16>;
    of(smooths(rates), active, gradient.touched, density, density_moment, features, feature_moment);
}

template <int kChannels, bool kSmooths>
void rmsPropLeafOf(const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                   float* density, float* density_moment, float* features, float* feature_moment) {
    constexpr hn::CappedTag<float, kChannels> row;
    constexpr int kRowLanes = static_cast<int>(hn::MaxLanes(row));
    constexpr int kRowVectors = kChannels / kRowLanes;
    const float keep = rates.decay, add = 1 - rates.decay;
    for (int word = 0; word < 8; ++word) {
        if (gradient.touched[word] == 0) continue;
        const FaceNeighbours neighbours(active, word);
        for (std::uint64_t bits = gradient.touched[word]; bits; bits &= bits - 1) {
            const int voxel = word * 64 + __builtin_ctzll(bits);
            const float g = gradient.density[voxel];
            gradient.density[voxel] = 0;
            density_moment[voxel] = keep * density_moment[voxel] + add * g * g;
            float pull = g / (__builtin_sqrtf(density_moment[voxel]) + rates.epsilon) + rates.sparsity;

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

            if constexpr (kSmooths) {
                const Around around(neighbours, voxel);
                pull += rates.density_smoothing * roughness(around, density[voxel], density);
                smoothRow<kChannels>(around, voxel, rates.feature_rate * rates.feature_smoothing, features);
            }
            density[voxel] -= rates.density_rate * pull;
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

template <int kChannels>
void rmsPropLeafOf(const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                   float* density, float* density_moment, float* features, float* feature_moment) {
    const auto of = smooths(rates) ? rmsPropLeafOf<kChannels, true> : rmsPropLeafOf<kChannels, false>;
    of(rates, active, gradient, density, density_moment, features, feature_moment);
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
HWY_EXPORT(prefetchLeaf);
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

void prefetchLeaf(int channels, const RmsPropRates& rates, const std::uint64_t* active, const LeafGradient& gradient,
                  const float* density, const float* density_moment, const float* features,
                  const float* feature_moment) {
    HWY_DYNAMIC_DISPATCH(prefetchLeaf)
    (channels, rates, active, gradient, density, density_moment, features, feature_moment);
}

}  // namespace nerfvdb::simd
#endif  // HWY_ONCE
