// SPDX-License-Identifier: Apache-2.0
#include "export/volume_of_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "vdb/vdb_file.h"

namespace nerfvdb {
namespace {

/// Sums at the voxels of another grid, leaf by leaf.
struct SumLeaf {
    std::array<float, kLeafVoxels> sigma{};
};

struct LeafOrder {
    bool operator()(const Vec3i& a, const Vec3i& b) const {
        return std::array{a.x(), a.y(), a.z()} < std::array{b.x(), b.y(), b.z()};
    }
};
using SumLeaves = std::map<Vec3i, SumLeaf, LeafOrder>;

/// Shares every voxel's extinction out to the eight coarse voxels around it, by their trilinear weights there.
SumLeaves spread(const VoxelField& field, double voxel_scale) {
    const Topology& topology = field.topology();
    const float share = static_cast<float>(1 / (voxel_scale * voxel_scale * voxel_scale));
    SumLeaves sums;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const float sigma = volumeSigma(field.density()[leaf * kLeafVoxels + offset], field.densityScale(),
                                            field.frame().voxel_size);
            const Vec3i voxel = topology.leafCoords()[leaf] * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const Vec3d at = voxel.cast<double>() / voxel_scale;
            const Vec3i low = at.array().floor().cast<int>();
            const Vec3f u = (at - low.cast<double>()).cast<float>();
            for (int corner = 0; corner < 8; ++corner) {
                const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
                float weight = share * sigma;
                for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
                if (weight == 0) continue;
                const Vec3i to = low + step;
                sums[to / kLeafDim].sigma[brickOffset(to.x() & 7, to.y() & 7, to.z() & 7)] += weight;
            }
        });
    return sums;
}

/// What a voxel that is worth keeping has at least; not zero, which would be no voxel of a volume.
double leastSigma(double voxel_size, double min_alpha) {
    return std::max<double>(-std::log1p(-min_alpha) / voxel_size, std::numeric_limits<float>::min());
}

/// Voxels of a leaf that are worth keeping, of sigma [512].
LeafMask visibleVoxels(const float* sigma, double voxel_size, double min_alpha) {
    const double least = leastSigma(voxel_size, min_alpha);
    LeafMask mask{};
    for (int offset = 0; offset < kLeafVoxels; ++offset)
        if (sigma[offset] >= least) setBit(mask, offset);
    return mask;
}

/// `sigmaOf(leaf coordinate, voxels that matter, sigma [512])` says what fills the volume.
template <typename SigmaOf>
Volume makeVolume(const std::vector<Topology::LeafCells>& active, const GridFrame& frame, const SigmaOf& sigmaOf) {
    Volume volume(active, frame);
    const float opaque = volumeSigma(kMaxRaw, 1e30, frame.voxel_size);
    parallelFor(volume.topology().leafCount(), [&](std::size_t leaf) {
        const LeafMask& wanted = volume.active()[leaf];
        if (wanted == LeafMask{}) return;
        std::array<float, kLeafVoxels> sigma;
        sigmaOf(volume.topology().leafCoords()[leaf] + volume.firstVoxel() / kLeafDim, wanted, sigma.data());
        forEachBit(wanted, [&](int offset) {
            volume.sigma()[leaf * kLeafVoxels + offset] = std::min(sigma[offset], opaque);
        });
    });
    return volume;
}

Volume onOwnVoxels(const VoxelField& field, double min_alpha) {
    const Topology& topology = field.topology();
    // By the logarithm: no exponential for what is left out. Nothing is more opaque than volumeSigma makes it.
    const double least = leastSigma(field.frame().voxel_size, min_alpha);
    const float min_raw = least <= volumeSigma(kMaxRaw, 1e30, field.frame().voxel_size)
                              ? static_cast<float>(std::log(least / field.densityScale()))
                              : std::numeric_limits<float>::infinity();
    std::vector<Topology::LeafCells> active(topology.leafCount());
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        active[leaf].leaf = topology.leafCoords()[leaf];
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            if (field.density()[leaf * kLeafVoxels + offset] >= min_raw) setBit(active[leaf].cells, offset);
        });
    });
    std::erase_if(active, [](const Topology::LeafCells& entry) { return entry.cells == LeafMask{}; });
    return makeVolume(active, field.frame(), [&](const Vec3i& leaf, const LeafMask& wanted, float* sigma) {
        const float* const raw = &field.density()[static_cast<std::size_t>(topology.findLeaf(leaf)) * kLeafVoxels];
        forEachBit(wanted, [&](int offset) {
            sigma[offset] = volumeSigma(raw[offset], field.densityScale(), field.frame().voxel_size);
        });
    });
}

/// Raw density between voxels, in index space; nothing where a voxel with a say is not active.
std::optional<float> rawBetween(const VoxelField& field, const Vec3d& at) {
    const Topology& topology = field.topology();
    const Vec3i low = at.array().floor().cast<int>();
    const Vec3f u = (at - low.cast<double>()).cast<float>();
    float raw = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
        float weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
        if (weight == 0) continue;
        const Vec3i voxel = low + step;
        const int leaf = topology.findLeaf(voxel / kLeafDim);
        const int offset = brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
        if (leaf < 0 || !testBit(topology.voxels()[leaf], offset)) return std::nullopt;
        raw += weight * field.density()[static_cast<std::size_t>(leaf) * kLeafVoxels + offset];
    }
    return raw;
}

Volume onFinerVoxels(const VoxelField& field, int times, double min_alpha) {
    const Topology& topology = field.topology();
    const GridFrame frame{field.frame().origin, field.frame().voxel_size / times};
    const int parts = times * times * times;
    const auto sigmaOf = [&](const Vec3i& leaf, float* sigma) {
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i voxel = leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const std::optional<float> raw = rawBetween(field, voxel.cast<double>() / times);
            sigma[offset] = raw ? volumeSigma(*raw, field.densityScale(), frame.voxel_size) : 0.0f;
        }
    };
    const auto partOf = [&](std::size_t i) {
        const int part = static_cast<int>(i % parts);
        return Vec3i(topology.leafCoords()[i / parts] * times +
                     Vec3i(part / (times * times), part / times % times, part % times));
    };
    std::vector<Topology::LeafCells> active(topology.leafCount() * parts);
    parallelFor(active.size(), [&](std::size_t i) {
        std::array<float, kLeafVoxels> sigma;
        active[i].leaf = partOf(i);
        sigmaOf(active[i].leaf, sigma.data());
        active[i].cells = visibleVoxels(sigma.data(), frame.voxel_size, min_alpha);
    });
    std::erase_if(active, [](const Topology::LeafCells& entry) { return entry.cells == LeafMask{}; });
    return makeVolume(active, frame, [&](const Vec3i& leaf, const LeafMask&, float* sigma) { sigmaOf(leaf, sigma); });
}

Volume onCoarserVoxels(const VoxelField& field, const VolumeGridOptions& options) {
    const GridFrame frame{field.frame().origin, field.frame().voxel_size * options.voxel_scale};
    const SumLeaves sums = spread(field, options.voxel_scale);
    std::vector<Topology::LeafCells> active;
    for (const auto& [coord, leaf] : sums)
        if (const LeafMask mask = visibleVoxels(leaf.sigma.data(), frame.voxel_size, options.min_alpha); mask != LeafMask{})
            active.push_back({coord, mask});
    return makeVolume(active, frame, [&](const Vec3i& leaf, const LeafMask&, float* out) {
        std::copy_n(sums.at(leaf).sigma.data(), kLeafVoxels, out);
    });
}

}  // namespace

Volume volumeOfModel(const VoxelField& field, const VolumeGridOptions& options) {
    if (!(options.min_alpha >= 0 && options.min_alpha < 1))
        throw UsageError("min_alpha", std::to_string(options.min_alpha), "a number in [0, 1)");
    for (const int times : {2, 3, 4})
        if (options.voxel_scale == 1.0 / times) return onFinerVoxels(field, times, options.min_alpha);
    if (!(options.voxel_scale >= 1) || !std::isfinite(options.voxel_scale))
        throw UsageError("voxel_scale", std::to_string(options.voxel_scale), "1/2, 1/3, 1/4 or a number of at least 1");
    return options.voxel_scale == 1 ? onOwnVoxels(field, options.min_alpha) : onCoarserVoxels(field, options);
}

}  // namespace nerfvdb
