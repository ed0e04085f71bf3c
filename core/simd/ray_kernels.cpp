// SPDX-License-Identifier: Apache-2.0
// Along rays: marching, and reading density and features, in portable vectors (Highway), compiled once per instruction
// set and dispatched at run time. kernels_reference.cpp says what each does; here is only how it is done quickly.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/ray_kernels.cpp"
#include <hwy/foreach_target.h>
// (foreach_target must come before highway.h)
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "core/prefetch.h"
#include "core/simd/kernels.h"
#include "core/simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nerfvdb::HWY_NAMESPACE {
namespace {

HWY_INLINE IntVec iota(std::int32_t first) { return hn::Iota(kInt, first); }

constexpr int kMarchBlock = 32;  // rays whose next leaves are found, and sent for, while those before are walked through

/// Where rays go on, [kMarchBlock] each: through leaf `leaf`, from sample k up to k_exit; nowhere if leaf is negative.
struct LeafVisits {
    HWY_ALIGN std::int32_t leaf[kMarchBlock], k[kMarchBlock], k_exit[kMarchBlock];
    HWY_ALIGN float x[kMarchBlock], y[kMarchBlock], z[kMarchBlock];  // the ray's origin, seen from the leaf's first voxel
};

/// One coordinate of kLanes rays.
struct MarchAxis {
    FloatVec origin, direction, inverse;
    IntVec last_leaf;        // leaf coordinates lie in [0, last_leaf]
    hn::Mask<IntTag> is_up;  // the ray leaves a leaf by its upper face

    MarchAxis(const float* o, const float* d, std::int32_t leaf_dim, IntVec rays)
        : origin(hn::GatherIndex(kFloat, o, rays)), direction(hn::GatherIndex(kFloat, d, rays)),
          last_leaf(hn::Set(kInt, leaf_dim - 1)) {
        // A ray along a face gets a huge inverse instead of an infinite one.
        const FloatVec smallest = hn::Set(kFloat, 1e-20f);
        const auto up = hn::Ge(direction, hn::Zero(kFloat));
        inverse = hn::Div(hn::Set(kFloat, 1.0f), hn::IfThenElse(up, hn::Max(direction, smallest),
                                                               hn::Min(direction, hn::Neg(smallest))));
        is_up = hn::RebindMask(kInt, up);
    }
    IntVec leafAt(FloatVec t) const {
        const IntVec leaf = hn::ShiftRight<3>(hn::ConvertTo(kInt, hn::MulAdd(direction, t, origin)));
        return hn::Min(hn::Max(leaf, hn::Zero(kInt)), last_leaf);
    }
    /// Distance to where the ray leaves the cube of all places nearer than `reach` to `place`, both in units of
    /// voxels, shifted by `shift`.
    FloatVec exitOf(IntVec place, IntVec reach, IntVec shift) const {
        const IntVec beyond = hn::IfThenElse(is_up, reach, hn::Sub(hn::Set(kInt, 1), reach));
        const IntVec face = hn::Shl(hn::Add(place, beyond), shift);
        return hn::Mul(hn::Sub(hn::ConvertTo(kFloat, face), origin), inverse);
    }
};

/// Walks kLanes rays side by side, by jumps over what is empty, each to its next leaf with occupied cells.
HWY_INLINE void findLeaves(const Bricks& bricks, const RayTile& rays, float step, const std::int32_t* alive, int n,
                           LeafVisits& visits, int slot) {
    const IntVec zero = hn::Zero(kInt), one = hn::Set(kInt, 1), none = hn::Set(kInt, -1);
    const auto is_ray = hn::FirstN(kInt, static_cast<std::size_t>(n));
    const IntVec ray = hn::IfThenElseZero(is_ray, hn::LoadU(kInt, alive));
    const MarchAxis x(rays.ox, rays.dx, bricks.leaf_dims[0], ray), y(rays.oy, rays.dy, bricks.leaf_dims[1], ray),
        z(rays.oz, rays.dz, bricks.leaf_dims[2], ray);
    const FloatVec length = hn::GatherIndex(kFloat, rays.length, ray);
    const FloatVec offset = hn::GatherIndex(kFloat, rays.offset, ray);
    const FloatVec steps = hn::Set(kFloat, step), inverse_step = hn::Set(kFloat, 1.0f / step);
    const IntVec ny = hn::Set(kInt, bricks.node_dims[1]), nz = hn::Set(kInt, bricks.node_dims[2]);
    // Where no node exists there may be no array; lanes that have no node read what is discarded, but read it.
    const std::int32_t* const skip_leaves = bricks.skip_leaves ? bricks.skip_leaves : bricks.skip_nodes;

    IntVec k = hn::IfThenElse(is_ray, hn::GatherIndex(kInt, rays.next, ray), none);
    IntVec leaf = none, k_exit = zero, leaf_x = zero, leaf_y = zero, leaf_z = zero;
    for (auto live = hn::Gt(k, none); !hn::AllFalse(kInt, live);) {
        const FloatVec t = hn::MulAdd(hn::ConvertTo(kFloat, k), steps, offset);
        live = hn::And(live, hn::RebindMask(kInt, hn::Lt(t, length)));
        const IntVec lx = x.leafAt(t), ly = y.leafAt(t), lz = z.leafAt(t);
        const IntVec nx_at = hn::ShiftRight<3>(lx), ny_at = hn::ShiftRight<3>(ly), nz_at = hn::ShiftRight<3>(lz);
        const IntVec node = hn::GatherIndex(
            kInt, bricks.skip_nodes, hn::Add(hn::Mul(hn::Add(hn::Mul(nx_at, ny), ny_at), nz), nz_at));
        const auto has_node = hn::Gt(node, none);
        const IntVec seven = hn::Set(kInt, 7);
        const IntVec in_node = hn::Or(hn::Or(hn::ShiftLeft<6>(hn::And(lx, seven)), hn::ShiftLeft<3>(hn::And(ly, seven))),
                                      hn::And(lz, seven));
        const IntVec found =
            hn::IfThenElse(has_node,
                           hn::GatherIndex(kInt, skip_leaves,
                                           hn::IfThenElseZero(has_node, hn::Or(hn::ShiftLeft<9>(node), in_node))),
                           node);
        const auto is_empty = hn::Lt(found, zero);

        // The cube to cross: this leaf, or all the empty leaves or nodes around it. The first sample at or beyond its
        // far side comes next; one step at least, whatever rounding says.
        const IntVec reach = hn::IfThenElse(is_empty, hn::Neg(found), one);
        const IntVec shift = hn::IfThenElse(has_node, hn::Set(kInt, 3), hn::Set(kInt, 6));
        const FloatVec t_exit =
            hn::Min(hn::Min(length, x.exitOf(hn::IfThenElse(has_node, lx, nx_at), reach, shift)),
                    hn::Min(y.exitOf(hn::IfThenElse(has_node, ly, ny_at), reach, shift),
                            z.exitOf(hn::IfThenElse(has_node, lz, nz_at), reach, shift)));
        const IntVec k_next = hn::Max(
            hn::ConvertTo(kInt, hn::Ceil(hn::Mul(hn::Sub(t_exit, offset), inverse_step))), hn::Add(k, one));

        const auto is_found = hn::AndNot(is_empty, live);
        leaf = hn::IfThenElse(is_found, found, leaf);
        k_exit = hn::IfThenElse(is_found, k_next, k_exit);
        leaf_x = hn::IfThenElse(is_found, lx, leaf_x);
        leaf_y = hn::IfThenElse(is_found, ly, leaf_y);
        leaf_z = hn::IfThenElse(is_found, lz, leaf_z);
        live = hn::And(live, is_empty);
        k = hn::IfThenElse(live, k_next, k);
    }
    hn::Store(leaf, kInt, visits.leaf + slot);
    hn::Store(k, kInt, visits.k + slot);
    hn::Store(k_exit, kInt, visits.k_exit + slot);
    hn::Store(hn::Sub(x.origin, hn::ConvertTo(kFloat, hn::ShiftLeft<3>(leaf_x))), kFloat, visits.x + slot);
    hn::Store(hn::Sub(y.origin, hn::ConvertTo(kFloat, hn::ShiftLeft<3>(leaf_y))), kFloat, visits.y + slot);
    hn::Store(hn::Sub(z.origin, hn::ConvertTo(kFloat, hn::ShiftLeft<3>(leaf_z))), kFloat, visits.z + slot);
    for (int lane = 0; lane < kLanes; ++lane) {
        const std::int32_t number = visits.leaf[slot + lane];
        if (number < 0) continue;
        prefetch(bricks.occupied + std::size_t(number) * 8);
        prefetch(bricks.upper_neighbours + std::size_t(number) * 8);
    }
}

constexpr int kLeafMaskWords = 16;  // of 32 bits, for the cells of a leaf

/// The mask of a leaf, in registers where they are wide enough.
class LeafBits {
public:
    explicit LeafBits(const std::int32_t* bits)
        : bits_(bits), first_(hn::LoadU(kInt, bits)), last_(hn::LoadU(kInt, bits + kLeafMaskWords - kLanes)) {}
    /// Word `at` of 32 bits for each lane.
    IntVec word(IntVec at) const {
        if constexpr (kLanes == kLeafMaskWords) {
            return lookUp(first_, at);
        } else if constexpr (2 * kLanes == kLeafMaskWords) {
            const IntVec lane = hn::And(at, hn::Set(kInt, kLanes - 1));
            return hn::IfThenElse(hn::Eq(lane, at), lookUp(first_, lane), lookUp(last_, lane));
        } else {
            return hn::GatherIndex(kInt, bits_, at);
        }
    }

private:
    static IntVec lookUp(IntVec words, IntVec lane) { return hn::TableLookupLanes(words, hn::IndicesFromVec(kInt, lane)); }
    const std::int32_t* bits_;
    IntVec first_, last_;
};

/// For each mask of 8 lanes the numbers of those that are set, then of the others.
struct PackedLanes {
    std::uint8_t lane[256][8];
    constexpr PackedLanes() : lane() {
        for (int bits = 0; bits < 256; ++bits) {
            int n = 0;
            for (int i = 0; i < 8; ++i)
                if (bits >> i & 1) lane[bits][n++] = static_cast<std::uint8_t>(i);
            for (int i = 0; i < 8; ++i)
                if (!(bits >> i & 1)) lane[bits][n++] = static_cast<std::uint8_t>(i);
        }
    }
};
constexpr PackedLanes kPackedLanes;

/// Moves the lanes that `keep` has to the front. Of 8 lanes without hn::Compress, whose table GCC copies to the stack at each call
/// (for AVX2, Highway 1.0: marching took 2.6 times as long).
class Packer {
public:
    explicit Packer(hn::Mask<IntTag> keep) : keep_(keep) {
        if constexpr (kLanes == 8) {
            std::uint8_t bits[8] = {};
            hn::StoreMaskBits(kInt, keep, bits);
            const hn::Rebind<std::uint8_t, IntTag> bytes;
            order_ = hn::PromoteTo(kInt, hn::LoadU(bytes, kPackedLanes.lane[bits[0]]));
        }
    }
    IntVec operator()(IntVec values) const {
        if constexpr (kLanes == 8) return hn::TableLookupLanes(values, hn::IndicesFromVec(kInt, order_));
        else return hn::Compress(values, keep_);
    }
    FloatVec operator()(FloatVec values) const {
        if constexpr (kLanes == 8) return hn::TableLookupLanes(values, hn::IndicesFromVec(kFloat, order_));
        else return hn::Compress(values, hn::RebindMask(kFloat, keep_));
    }

private:
    hn::Mask<IntTag> keep_;
    IntVec order_;
};

int marchRays(const Bricks& bricks, const RayTile& rays, float step, int max_per_ray, const std::int32_t* alive,
              int n_alive, std::int32_t* begin, const SampleArrays& out) {
    const FloatVec zero = hn::Zero(kFloat), one = hn::Set(kFloat, 1.0f), seven = hn::Set(kFloat, 7.0f);
    LeafVisits blocks[2];
    const auto find = [&](int block) HWY_ATTR {
        for (int slot = 0, a = block * kMarchBlock; slot < kMarchBlock && a < n_alive; slot += kLanes, a += kLanes)
            findLeaves(bricks, rays, step, alive + a, n_alive - a, blocks[block & 1], slot);
    };
    find(0);
    int n = 0;
    for (int a = 0; a < n_alive; ++a) {
        const int block = a / kMarchBlock, slot = a % kMarchBlock;
        if (slot == 0) find(block + 1);
        const LeafVisits& visits = blocks[block & 1];
        begin[a] = n;
        const std::int32_t leaf = visits.leaf[slot], r = alive[a];
        if (leaf < 0) {
            rays.next[r] = -1;
            continue;
        }

        const std::int32_t k_first = visits.k[slot];
        const std::int32_t n_steps = visits.k_exit[slot] - k_first;
        const std::int32_t k_end = k_first + (n_steps < max_per_ray ? n_steps : max_per_ray);
        const LeafBits bits(reinterpret_cast<const std::int32_t*>(bricks.occupied + std::size_t(leaf) * 8));
        const FloatVec dx = hn::Set(kFloat, rays.dx[r]), lx = hn::Set(kFloat, visits.x[slot]);
        const FloatVec dy = hn::Set(kFloat, rays.dy[r]), ly = hn::Set(kFloat, visits.y[slot]);
        const FloatVec dz = hn::Set(kFloat, rays.dz[r]), lz = hn::Set(kFloat, visits.z[slot]);
        const FloatVec steps = hn::Set(kFloat, step), offset = hn::Set(kFloat, rays.offset[r]);
        for (std::int32_t k = k_first; k < k_end; k += kLanes) {
            const IntVec ks = iota(k);
            const FloatVec ts = hn::MulAdd(hn::ConvertTo(kFloat, ks), steps, offset);
            const FloatVec px = hn::MulAdd(dx, ts, lx), py = hn::MulAdd(dy, ts, ly), pz = hn::MulAdd(dz, ts, lz);
            const IntVec cx = hn::ConvertTo(kInt, hn::Min(hn::Max(px, zero), seven));
            const IntVec cy = hn::ConvertTo(kInt, hn::Min(hn::Max(py, zero), seven));
            const IntVec cz = hn::ConvertTo(kInt, hn::Min(hn::Max(pz, zero), seven));
            const IntVec word = hn::Or(hn::ShiftLeft<1>(cx), hn::ShiftRight<2>(cy));
            const IntVec bit = hn::Or(hn::ShiftLeft<3>(hn::And(cy, hn::Set(kInt, 3))), cz);
            const IntVec occupied = hn::And(bits.word(word), hn::Shl(hn::Set(kInt, 1), bit));
            const auto keep = hn::And(hn::Ne(occupied, hn::Zero(kInt)), hn::Lt(ks, hn::Set(kInt, k_end)));
            if (hn::AllFalse(kInt, keep)) continue;
            const Packer packed(keep);
            const auto fraction = [&](FloatVec p, IntVec c) HWY_ATTR {
                return hn::Min(hn::Max(hn::Sub(p, hn::ConvertTo(kFloat, c)), zero), one);
            };
            const IntVec cell = hn::Or(hn::Or(hn::ShiftLeft<6>(cx), hn::ShiftLeft<3>(cy)), cz);
            hn::StoreU(hn::Set(kInt, leaf), kInt, out.leaf + n);
            hn::StoreU(packed(cell), kInt, out.cell + n);
            hn::StoreU(packed(fraction(px, cx)), kFloat, out.x + n);
            hn::StoreU(packed(fraction(py, cy)), kFloat, out.y + n);
            hn::StoreU(packed(fraction(pz, cz)), kFloat, out.z + n);
            hn::StoreU(packed(ts), kFloat, out.t + n);
            n += static_cast<int>(hn::CountTrue(kInt, keep));
        }
        const bool has_ended = !(static_cast<float>(k_end) * step + rays.offset[r] < rays.length[r]);
        rays.next[r] = has_ended ? -1 : k_end;
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

/// Where the densities of kPadding samples lie: found, and sent for, before they are needed.
struct DensityPlaces {
    HWY_ALIGN std::int32_t pair[4][kPadding];  // value numbers of the corners with the lower z, by x and y ...
    std::uint32_t crossing = 0;                // ... but of samples whose cell reaches into the leaf above in z ...
    std::int32_t corner[kPadding][8];          // ... of all corners
};

HWY_INLINE void findDensities(const Bricks& bricks, const SampleArrays& samples, int i, DensityPlaces& places) {
    const IntVec seven = hn::Set(kInt, 7), one = hn::Set(kInt, 1), zero = hn::Zero(kInt);
    places.crossing = 0;
    for (int lane = 0; lane < kPadding; lane += kLanes) {
        const IntVec leaf = hn::LoadU(kInt, samples.leaf + i + lane), cell = hn::LoadU(kInt, samples.cell + i + lane);
        const IntVec x = hn::ShiftRight<6>(cell), y = hn::And(hn::ShiftRight<3>(cell), seven);
        const IntVec z = hn::And(cell, seven);
        const IntVec at_x[2] = {hn::ShiftLeft<6>(x), hn::ShiftLeft<6>(hn::And(hn::Add(x, one), seven))};
        const IntVec at_y[2] = {hn::ShiftLeft<3>(y), hn::ShiftLeft<3>(hn::And(hn::Add(y, one), seven))};
        const IntVec at_z = hn::Min(z, hn::Set(kInt, 6));  // of a pair that lies in the leaf, whether it is the right one
        const auto crosses_x = hn::Eq(x, seven), crosses_y = hn::Eq(y, seven);
        IntVec owner[4];
        for (IntVec& brick : owner) brick = hn::ShiftLeft<9>(leaf);
        if (!hn::AllFalse(kInt, hn::Or(crosses_x, crosses_y))) {
            const IntVec neighbours = hn::ShiftLeft<3>(leaf);
            const IntVec next_x = hn::IfThenElse(crosses_x, hn::Set(kInt, 4), zero);
            const IntVec next_y = hn::IfThenElse(crosses_y, hn::Set(kInt, 2), zero);
            for (int pair = 1; pair < 4; ++pair) {
                IntVec crossed = neighbours;
                if (pair & 2) crossed = hn::Add(crossed, next_x);
                if (pair & 1) crossed = hn::Add(crossed, next_y);
                owner[pair] = hn::ShiftLeft<9>(hn::GatherIndex(kInt, bricks.upper_neighbours, crossed));
            }
        }
        for (int pair = 0; pair < 4; ++pair)
            hn::Store(hn::Add(hn::Add(owner[pair], at_x[pair >> 1]), hn::Add(at_y[pair & 1], at_z)), kInt,
                      places.pair[pair] + lane);
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(kInt, hn::Eq(z, seven), bytes);
        places.crossing |= static_cast<std::uint32_t>(bytes[0] | bytes[1] << 8) << lane;
    }
    for (int pair = 0; pair < 4; ++pair)
        for (int s = 0; s < kPadding; ++s) prefetch(bricks.density + places.pair[pair][s]);
    for (std::uint32_t left = places.crossing; left; left &= left - 1) {
        const int s = __builtin_ctz(left);
        for (int corner = 0; corner < 8; ++corner) {
            places.corner[s][corner] =
                static_cast<std::int32_t>(cornerIndex(bricks, samples.leaf[i + s], samples.cell[i + s], corner));
            if (corner & 1) prefetch(bricks.density + places.corner[s][corner]);
        }
    }
}

/// Densities at the corners of kPadding cells, two neighbours in z side by side: [x, y of the corner][sample][z].
using CornerDensities = float[4][2 * kPadding];

/// Plain loads: a gather of so many lanes takes as long as loading each, and pairs are loaded as one.
HWY_INLINE void loadDensities(const Bricks& bricks, const DensityPlaces& places, CornerDensities& pairs) {
    for (int pair = 0; pair < 4; ++pair)
        for (int s = 0; s < kPadding; ++s)
            __builtin_memcpy(&pairs[pair][2 * s], bricks.density + places.pair[pair][s], 2 * sizeof(float));
    for (std::uint32_t left = places.crossing; left; left &= left - 1) {
        const int s = __builtin_ctz(left);
        for (int corner = 0; corner < 8; ++corner)
            pairs[corner >> 1][2 * s + (corner & 1)] = bricks.density[places.corner[s][corner]];
    }
}

/// Calls use(j, values) for the trilinear densities of all samples, kLanes at a time from the j-th on.
template <typename Use>
HWY_INLINE void forEachDensity(const Bricks& bricks, int n, const SampleArrays& samples, const Use& use) {
    constexpr int kAhead = 3;  // times kPadding samples, whose densities are on their way
    DensityPlaces places[kAhead + 1];
    HWY_ALIGN CornerDensities pairs;
    const auto find = [&](int i) HWY_ATTR {
        if (i < n) findDensities(bricks, samples, i, places[i / kPadding % (kAhead + 1)]);
    };
    for (int i = 0; i < kAhead * kPadding; i += kPadding) find(i);
    for (int i = 0; i < n; i += kPadding) {
        find(i + kAhead * kPadding);
        loadDensities(bricks, places[i / kPadding % (kAhead + 1)], pairs);
        for (int lane = 0; lane < kPadding; lane += kLanes) {
            const FloatVec fx = hn::LoadU(kFloat, samples.x + i + lane), fy = hn::LoadU(kFloat, samples.y + i + lane),
                           fz = hn::LoadU(kFloat, samples.z + i + lane);
            const FloatVec unit = hn::Set(kFloat, 1.0f);
            const FloatVec gx = hn::Sub(unit, fx), gy = hn::Sub(unit, fy), gz = hn::Sub(unit, fz);
            const FloatVec weight[4] = {hn::Mul(gx, gy), hn::Mul(gx, fy), hn::Mul(fx, gy), hn::Mul(fx, fy)};
            FloatVec lower = hn::Zero(kFloat), upper = hn::Zero(kFloat);
            for (int pair = 0; pair < 4; ++pair) {
                FloatVec below, above;
                hn::LoadInterleaved2(kFloat, pairs[pair] + 2 * lane, below, above);
                lower = hn::MulAdd(weight[pair], below, lower);
                upper = hn::MulAdd(weight[pair], above, upper);
            }
            use(i + lane, hn::MulAdd(gz, lower, hn::Mul(fz, upper)));
        }
    }
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
    forEachDensity(bricks, n, samples, [&](int i, FloatVec value) HWY_ATTR {
        hn::StoreU(value, kFloat, raw + i);
        const FloatVec sigma = hn::Exp(kFloat, hn::Min(value, hn::Set(kFloat, max_raw)));
        storeAbsorption(hn::Mul(sigma, hn::Set(kFloat, tau_scale)), tau + i, alpha + i, decay + i);
    });
}

void sigmaForward(const Bricks& bricks, int n, const SampleArrays& samples, float tau_scale, float* tau, float* alpha,
                  float* decay) {
    padSamples(samples, n);
    forEachDensity(bricks, n, samples, [&](int i, FloatVec value) HWY_ATTR {
        storeAbsorption(hn::Mul(value, hn::Set(kFloat, tau_scale)), tau + i, alpha + i, decay + i);
    });
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
                prefetch(bricks.features + std::size_t(index[slot][corner][s]) * kChannels);
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
