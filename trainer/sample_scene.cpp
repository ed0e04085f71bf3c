// SPDX-License-Identifier: Apache-2.0
#include "trainer/sample_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr int kChannels = 4;
constexpr double kNothing = 1e-6;  // share of the largest density below which a corner counts as empty

/// The cells of one leaf that have a corner with density. Corners reach one voxel into the upper neighbours.
LeafMask occupiedCells(const SyntheticScene& scene, const GridFrame& frame, const Vec3i& leaf,
                       const Vec3i& dims) {
    constexpr int kCorners = kLeafDim + 1;
    std::array<bool, kCorners * kCorners * kCorners> filled{};
    const double floor = kNothing * scene.maxDensity();
    const auto at = [](int x, int y, int z) { return (x * kCorners + y) * kCorners + z; };
    for (int x = 0; x < kCorners; ++x)
        for (int y = 0; y < kCorners; ++y)
            for (int z = 0; z < kCorners; ++z) {
                const Vec3i ijk = kLeafDim * leaf + Vec3i(x, y, z);
                filled[at(x, y, z)] = scene.density(frame.worldFromIndex(ijk.cast<double>())) > floor;
            }
    LeafMask cells{};
    for (int x = 0; x < kLeafDim; ++x)
        for (int y = 0; y < kLeafDim; ++y)
            for (int z = 0; z < kLeafDim; ++z) {
                if (((kLeafDim * leaf + Vec3i(x, y, z)).array() >= dims.array() - 1).any()) continue;
                bool any = false;
                for (int c = 0; c < 8; ++c) any |= filled[at(x + (c >> 2), y + (c >> 1 & 1), z + (c & 1))];
                if (any) setBit(cells, brickOffset(x, y, z));
            }
    return cells;
}

Topology occupiedTopology(const SyntheticScene& scene, const GridFrame& frame, const Vec3i& dims) {
    const Vec3i leaves = dims / kLeafDim;
    // One row of leaves at a time, put together in order: memory follows what is found, not the box.
    std::vector<std::vector<Topology::LeafCells>> rows(static_cast<std::size_t>(leaves.x()) * leaves.y());
    parallelFor(rows.size(), [&](std::size_t row) {
        const int x = static_cast<int>(row) / leaves.y(), y = static_cast<int>(row) % leaves.y();
        for (int z = 0; z < leaves.z(); ++z) {
            const Vec3i leaf(x, y, z);
            const Vec3d centre =
                frame.worldFromIndex((kLeafDim * (leaf.cast<double>().array() + 0.5)).matrix());
            const double reach = 0.5 * kLeafDim * std::sqrt(3.0) * frame.voxel_size;
            if (scene.emptyRadius(centre) > reach) continue;
            const LeafMask cells = occupiedCells(scene, frame, leaf, dims);
            if (std::any_of(cells.begin(), cells.end(), [](std::uint64_t word) { return word != 0; }))
                rows[row].push_back({leaf, cells});
        }
    });
    std::vector<Topology::LeafCells> all;
    for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
    return Topology(dims, all);
}

float logit(double rgb) {
    // A sigmoid never quite reaches 0 or 1; half an 8-bit level short of them is near enough.
    const double p = std::clamp(rgb, 0.5 / 255.0, 1.0 - 0.5 / 255.0);
    return static_cast<float>(std::log(p / (1.0 - p)));
}

}  // namespace

Model sampleScene(const SyntheticScene& scene, int resolution) {
    if (resolution < kLeafDim || resolution > 2048)
        throw UsageError("sampleScene: resolution", std::to_string(resolution), "8 to 2048 voxels");
    const Box box = scene.bounds();
    const GridFrame frame{box.min, box.size().maxCoeff() / (resolution - 1)};
    const Vec3i voxels = (box.size() / frame.voxel_size).array().ceil().cast<int>() + 1;
    const Vec3i dims = (voxels.array() + kLeafDim - 1) / kLeafDim * kLeafDim;
    const double scale = scene.maxDensity();

    Model model;
    model.field = VoxelField(occupiedTopology(scene, frame, dims), frame, kChannels, scale);
    VoxelField& field = model.field;
    const Topology& topology = field.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        const Vec3i origin = kLeafDim * topology.leafCoords()[leaf];
        for (int v = 0; v < kLeafVoxels; ++v) {
            if (!testBit(topology.voxels()[leaf], v)) continue;
            const Vec3i ijk = origin + Vec3i(v >> 6, v >> 3 & 7, v & 7);
            const Vec3d point = frame.worldFromIndex(ijk.cast<double>());
            const std::size_t slot = leaf * kLeafVoxels + static_cast<std::size_t>(v);
            const double raw = std::log(scene.density(point) / scale);  // -inf where empty
            field.density()[slot] = std::max(static_cast<float>(raw), kEmptyRaw);
            const Vec3d rgb = scene.diffuse(point);
            for (int c = 0; c < 3; ++c) field.features()[slot * kChannels + c] = logit(rgb[c]);
        }
    });
    model.decoder = Decoder(kChannels, 0);
    std::ranges::fill(model.decoder.parameters(), 0.0f);
    return model;
}

}  // namespace nerfvdb
