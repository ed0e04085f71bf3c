// SPDX-License-Identifier: Apache-2.0
#include "export/block_fields.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "export/flat_model.h"
#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

std::string blockText(const BlockId& block) {
    return "block " + std::to_string(block.i) + "," + std::to_string(block.j);
}

Vec3i voxelIn(int offset) { return {offset >> 6, offset >> 3 & 7, offset & 7}; }

/// Halvings from the grid's voxels to a block's. Throws DataError where the two do not fit.
int levelOf(const BlockGrid& grid, const BlockId& block, const VoxelField& field) {
    constexpr double kSlack = 1e-3;  // voxels: what positions far from zero round
    const double ratio = grid.voxel_size / field.frame().voxel_size;
    const int level = static_cast<int>(std::lround(std::log2(ratio)));
    const Vec3d apart = (field.frame().origin - grid.box(block).min) / field.frame().voxel_size;
    if (!(std::abs(ratio - std::ldexp(1.0, level)) < kSlack * ratio) || level < 0 || !(apart.norm() < kSlack))
        throw DataError(blockText(block), "a model that lies elsewhere, or has other voxels", "the block of blocks.json",
                        "train it again");
    return level;
}

/// Shares of a block at the corners of its voxels.
class VoxelWeights {
public:
    VoxelWeights(const BlockGrid& grid, const BlockId& block, const GridFrame& frame)
        : grid_(grid), block_(block), frame_(frame) {}
    double at(const Vec3i& voxel) const { return grid_.weight(block_, frame_.worldFromIndex(voxel.cast<double>())); }
    /// Whether any of a cell is the block's: where it counts is a box, larger than a cell.
    bool touches(const Vec3i& cell) const { return at(cell) > 0 || at(cell + Vec3i::Ones()) > 0; }

private:
    const BlockGrid& grid_;
    BlockId block_;
    GridFrame frame_;
};

/// [leaf] cells of a field in which its block counts.
std::vector<LeafMask> ownCells(const BlockGrid& grid, const BlockId& block, const VoxelField& field) {
    const VoxelWeights weights(grid, block, field.frame());
    const Topology& topology = field.topology();
    std::vector<LeafMask> own(topology.leafCount());
    parallelFor(own.size(), [&](std::size_t leaf) {
        own[leaf] = {};
        forEachBit(topology.cells()[leaf], [&](int offset) {
            if (weights.touches(topology.leafCoords()[leaf] * kLeafDim + voxelIn(offset))) setBit(own[leaf], offset);
        });
    });
    return own;
}

[[noreturn]] void failEmpty(const BlockId& block) {
    throw DataError(blockText(block), "a model without anything in the block's own part", "a part of the scene");
}

}  // namespace

Model fadedBlock(const BlockGrid& grid, const BlockId& block, const Model& model) {
    Model faded = flatModel(model, 1);
    levelOf(grid, block, faded.field);
    Topology kept = prune(faded.field.topology(), ownCells(grid, block, faded.field));
    if (kept.cellCount() == 0) failEmpty(block);
    faded.field = copyField(faded.field, std::move(kept));

    const VoxelWeights weights(grid, block, faded.field.frame());
    const Topology& topology = faded.field.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            float& raw = faded.field.density()[leaf * kLeafVoxels + offset];
            const double weight = weights.at(topology.leafCoords()[leaf] * kLeafDim + voxelIn(offset));
            if (weight == 1) return;
            // The activation's clamp comes first: half of what is opaque is half.
            raw = weight > 0 ? std::max(kEmptyRaw, std::min(raw, kMaxRaw) + static_cast<float>(std::log(weight))) : kEmptyRaw;
        });
    });
    return faded;
}

BlockDensity densityOfBlock(const BlockGrid& grid, const BlockId& block, const Model& model) {
    Model inner = flatModel(model, 1);
    levelOf(grid, block, inner.field);
    VoxelField density(prune(inner.field.topology(), inner.field.topology().cells()), inner.field.frame(), /*channels=*/0,
                       inner.field.densityScale());
    std::copy(inner.field.density().begin(), inner.field.density().end(), density.density().begin());
    return {block, std::move(density)};
}

Model joinBlocks(const BlockGrid& grid, std::vector<BlockDensity> blocks) {
    if (blocks.empty()) throw DataError("blocks", "none", "at least one trained block");
    int finest = 0;
    for (const BlockDensity& part : blocks) finest = std::max(finest, levelOf(grid, part.block, part.field));
    std::vector<Topology::LeafCells> cells;
    const auto shiftOf = [&](const BlockId& block) { return Vec3i(grid.coreCorner(block) * (1 << finest) / kLeafDim); };
    for (BlockDensity& part : blocks) {
        while (levelOf(grid, part.block, part.field) < finest)
            part.field = refineField(part.field, subdivide(part.field.topology(), part.field.topology().cells()));
        const Topology& topology = part.field.topology();
        const std::vector<LeafMask> own = ownCells(grid, part.block, part.field);
        for (std::size_t leaf = 0; leaf < own.size(); ++leaf)
            if (own[leaf] != LeafMask{}) cells.push_back({topology.leafCoords()[leaf] + shiftOf(part.block), own[leaf]});
    }
    if (cells.empty()) throw DataError("blocks", "models without anything in them", "a part of the scene");

    Model joined;
    // From the lowest corner of the first block's box: there every block begins with a whole leaf.
    const BlockId last{grid.columns - 1, grid.rows - 1};
    const Vec3i extent = (grid.coreCorner(last) + grid.core + 2 * grid.margin()) * (1 << finest);
    const GridFrame frame{grid.box({0, 0}).min, std::ldexp(grid.voxel_size, -finest)};
    const double density_scale = blocks.front().field.densityScale();
    joined.field = VoxelField(Topology((extent + Vec3i::Constant(kLeafDim)) / kLeafDim * kLeafDim, cells), frame,
                              /*channels=*/0, density_scale);
    const Topology& topology = joined.field.topology();
    const auto sum = joined.field.density();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        std::array<double, kLeafVoxels> sigma{};
        for (const BlockDensity& part : blocks) {
            const Vec3i own_leaf = topology.leafCoords()[leaf] - shiftOf(part.block);
            const int from = part.field.topology().findLeaf(own_leaf);
            if (from < 0) continue;
            const VoxelWeights weights(grid, part.block, part.field.frame());
            const LeafMask& voxels = part.field.topology().voxels()[static_cast<std::size_t>(from)];
            forEachBit(voxels, [&](int offset) {
                const float raw = part.field.density()[static_cast<std::size_t>(from) * kLeafVoxels + offset];
                sigma[offset] += weights.at(own_leaf * kLeafDim + voxelIn(offset)) *
                                 sigmaFromRaw(raw, part.field.densityScale());
            });
        }
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            sum[leaf * kLeafVoxels + offset] =
                sigma[offset] > 0 ? std::max(kEmptyRaw, static_cast<float>(std::log(sigma[offset] / density_scale)))
                                  : kEmptyRaw;
        });
    });
    return joined;
}

}  // namespace nerfvdb
