// SPDX-License-Identifier: Apache-2.0
#include "export/resample_field.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace nerfvdb {
namespace {

constexpr double kOutsideVoice = 1e-3;  // of a voxel outside in a mean of features: heard where none is inside

/// The new voxels and how they lie among the old ones; both indices count in voxels of their own lattice.
struct Lattice {
    double ratio;  // edge of a new voxel, in old ones
    int margin;    // new voxels before the first old one: the surface reaches one old voxel beyond the field
    Vec3i dims;    // in new voxels, multiples of 8
    GridFrame frame;

    Lattice(const VoxelField& field, double voxel_size)
        : ratio(voxel_size / field.frame().voxel_size), margin(static_cast<int>(std::ceil(1 / ratio))) {
        for (int axis = 0; axis < 3; ++axis) {
            const int n = margin + static_cast<int>(std::ceil(field.topology().dims()[axis] / ratio)) + 2;
            dims[axis] = (n + kLeafDim - 1) / kLeafDim * kLeafDim;
        }
        frame = {field.frame().origin - Vec3d::Constant(margin * voxel_size), voxel_size};
    }

    double oldFromNew(double index) const { return (index - margin) * ratio; }
    double newFromOld(double index) const { return index / ratio + margin; }
    int leafOf(double new_index, int axis) const {
        return std::clamp(static_cast<int>(std::floor(new_index)) >> 3, 0, dims[axis] / kLeafDim - 1);
    }
};

bool isBefore(const Vec3i& a, const Vec3i& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

void sortUnique(std::vector<Vec3i>& places) {
    std::sort(places.begin(), places.end(), isBefore);
    places.erase(std::unique(places.begin(), places.end()), places.end());
}

/// Adds all leaves of the new lattice that share space with the old voxels [low, high].
void addLeaves(const Lattice& lattice, const Vec3d& low, const Vec3d& high, std::vector<Vec3i>& leaves) {
    Vec3i first, last, leaf;
    for (int axis = 0; axis < 3; ++axis) {
        first[axis] = lattice.leafOf(lattice.newFromOld(low[axis]) - 1, axis);
        last[axis] = lattice.leafOf(lattice.newFromOld(high[axis]) + 1, axis);
    }
    for (leaf.x() = first.x(); leaf.x() <= last.x(); ++leaf.x())
        for (leaf.y() = first.y(); leaf.y() <= last.y(); ++leaf.y())
            for (leaf.z() = first.z(); leaf.z() <= last.z(); ++leaf.z()) leaves.push_back(leaf);
}

template <typename CellsOf>
Topology topologyOf(const Lattice& lattice, const std::vector<Vec3i>& leaves, const CellsOf& cellsOf) {
    std::vector<Topology::LeafCells> cells(leaves.size());
    parallelFor(leaves.size(), [&](std::size_t i) { cells[i] = {leaves[i], cellsOf(leaves[i])}; });
    return Topology(lattice.dims, cells);
}

// --- coarser
// -------------------------------------------------------------------------------------------------------

/// Share of a cell that is inside, from its corners' values above the surface's.
float insideShare(const std::array<float, 8>& above) {
    constexpr int kColumns = 4;
    float sum = 0;
    for (int i = 0; i < kColumns; ++i)
        for (int j = 0; j < kColumns; ++j) {
            const float u = (static_cast<float>(i) + 0.5f) / kColumns,
                        v = (static_cast<float>(j) + 0.5f) / kColumns;
            const auto across = [&](int z) {
                return (1 - u) * ((1 - v) * above[z] + v * above[2 + z]) +
                       u * ((1 - v) * above[4 + z] + v * above[6 + z]);
            };
            const float low = across(0), high = across(1);
            if ((low >= 0) == (high >= 0))
                sum += low >= 0 ? 1.0f : 0.0f;
            else
                sum += low >= 0 ? low / (low - high) : high / (high - low);
        }
    return sum / (kColumns * kColumns);
}

/// The old cells in one leaf's place that have something inside.
struct Block {
    Vec3i place;
    std::array<float, kLeafVoxels> share{};
};

/// False if nothing is.
bool measureBlock(const Surface& surface, Block& block) {
    const BlockCorners corners(surface, block.place);
    bool any = false;
    for (int x = 0; x < kLeafDim; ++x)
        for (int y = 0; y < kLeafDim; ++y) {
            const unsigned row[4] = {corners.row(x, y), corners.row(x, y + 1), corners.row(x + 1, y),
                                     corners.row(x + 1, y + 1)};
            const unsigned some = row[0] | row[1] | row[2] | row[3], all = row[0] & row[1] & row[2] & row[3];
            forEachBit((some | some >> 1) & 0xff, [&](int z) {
                any = true;
                float& share = block.share[brickOffset(x, y, z)];
                if ((all & all >> 1) >> z & 1) {
                    share = 1;
                    return;
                }
                std::array<float, 8> above;
                for (int c = 0; c < 8; ++c) {
                    const bool is_inside = row[c >> 1] >> (z + (c & 1)) & 1;
                    above[c] = corners.value(x + (c >> 2), y + (c >> 1 & 1), z + (c & 1)) - surface.iso;
                    if (is_inside && above[c] < 0) above[c] = surface.iso - kEmptyRaw;  // filled
                }
                share = insideShare(above);
            });
        }
    return any;
}

/// All blocks with something inside, sorted by place.
std::vector<Block> measureBlocks(const Surface& surface) {
    const Topology& topology = surface.field.topology();
    std::vector<Vec3i> places;
    const auto add = [&](const Vec3i& leaf) {
        for (int corner = 0; corner < 8; ++corner) places.push_back(leaf - cornerStep(corner));
    };
    for (const Vec3i& leaf : topology.leafCoords()) add(leaf);
    if (surface.is_filled) {
        Vec3i leaf;
        const Vec3i end = topology.dims() / kLeafDim;
        for (leaf.x() = 0; leaf.x() < end.x(); ++leaf.x())
            for (leaf.y() = 0; leaf.y() < end.y(); ++leaf.y())
                for (leaf.z() = 0; leaf.z() < end.z(); ++leaf.z())
                    if (surface.enclosed.contains(leaf)) add(leaf);
    }
    sortUnique(places);
    std::vector<Block> blocks(places.size());
    std::vector<char> any(places.size());
    parallelFor(places.size(), [&](std::size_t i) {
        blocks[i].place = places[i];
        any[i] = measureBlock(surface, blocks[i]);
    });
    std::size_t n = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i)
        if (any[i]) blocks[n++] = blocks[i];
    blocks.resize(n);
    return blocks;
}

/// Where eight old positions in a row lie among the voxels of a new leaf: between `base` and `base` + 1.
struct Row {
    std::array<int, kLeafDim> base;
    std::array<float, kLeafDim> upper;  // weight of the second of them

    Row(const Lattice& lattice, int old_leaf, double offset, int new_leaf) {
        for (int i = 0; i < kLeafDim; ++i) {
            const double at = lattice.newFromOld(old_leaf * kLeafDim + i + offset) - new_leaf * kLeafDim;
            base[i] = static_cast<int>(std::floor(at));
            upper[i] = static_cast<float>(at - base[i]);
        }
    }
};

/// Calls visit(new offset, old offset, weight) for all pairs of an old leaf's or block's bits and a new leaf's
/// voxels whose tents hold them.
template <typename Bits, typename Visit>
void forEachPair(const std::array<Row, 3>& rows, const Bits& isWanted, const Visit& visit) {
    for (int offset = 0; offset < kLeafVoxels; ++offset) {
        if (!isWanted(offset)) continue;
        const int at[3] = {offset >> 6, offset >> 3 & 7, offset & 7};
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step = cornerStep(corner);
            Vec3i voxel;
            float weight = 1;
            for (int axis = 0; axis < 3; ++axis) {
                voxel[axis] = rows[axis].base[at[axis]] + step[axis];
                weight *= step[axis] ? rows[axis].upper[at[axis]] : 1 - rows[axis].upper[at[axis]];
            }
            if (((voxel.x() | voxel.y() | voxel.z()) & ~7) || weight == 0) continue;
            visit(brickOffset(voxel.x(), voxel.y(), voxel.z()), offset, weight);
        }
    }
}

std::array<Row, 3> rowsOf(const Lattice& lattice, const Vec3i& old_leaf, double offset, const Vec3i& new_leaf) {
    return {Row(lattice, old_leaf.x(), offset, new_leaf.x()), Row(lattice, old_leaf.y(), offset, new_leaf.y()),
            Row(lattice, old_leaf.z(), offset, new_leaf.z())};
}

/// Calls visit(place) for the places of old leaves, absent ones too, within the tents of a new leaf's voxels.
template <typename Visit>
void forEachOldLeaf(const Lattice& lattice, const Vec3i& new_leaf, const Visit& visit) {
    Vec3i first, last, place;
    for (int axis = 0; axis < 3; ++axis) {
        first[axis] = static_cast<int>(std::floor(lattice.oldFromNew(new_leaf[axis] * kLeafDim - 1))) >> 3;
        last[axis] = static_cast<int>(std::ceil(lattice.oldFromNew((new_leaf[axis] + 1) * kLeafDim))) >> 3;
    }
    for (place.x() = first.x(); place.x() <= last.x(); ++place.x())
        for (place.y() = first.y(); place.y() <= last.y(); ++place.y())
            for (place.z() = first.z(); place.z() <= last.z(); ++place.z()) visit(place);
}

/// Sum of a tent over all middles of old cells, for each of a new leaf's eight places along an axis.
std::array<double, kLeafDim> tentSums(const Lattice& lattice, int new_leaf) {
    std::array<double, kLeafDim> sums{};
    for (int i = 0; i < kLeafDim; ++i) {
        const int voxel = new_leaf * kLeafDim + i;
        const int last = static_cast<int>(std::ceil(lattice.oldFromNew(voxel + 1)));
        for (int old = static_cast<int>(std::floor(lattice.oldFromNew(voxel - 1))) - 1; old <= last; ++old)
            sums[i] += std::max(0.0, 1 - std::abs(lattice.newFromOld(old + 0.5) - voxel));
    }
    return sums;
}

/// Distance from a plane in tent widths, -1 to 1, by the share of its inside that a tent sees.
double distanceOfShare(double share) {
    return share < 0.5 ? std::sqrt(2 * std::max(share, 0.0)) - 1 : 1 - std::sqrt(2 * std::max(1 - share, 0.0));
}

void meanFeatures(const Surface& surface, const Lattice& lattice, std::size_t leaf, VoxelField& result) {
    const VoxelField& field = surface.field;
    const std::size_t channels = field.channels();
    const Vec3i place = result.topology().leafCoords()[leaf];
    float* const means = &result.features()[leaf * kLeafVoxels * channels];
    std::array<float, kLeafVoxels> weights{};
    forEachOldLeaf(lattice, place, [&](const Vec3i& old) {
        const int number = field.topology().findLeaf(old);
        if (number < 0) return;
        const auto isActive = [&](int offset) { return testBit(field.topology().voxels()[number], offset); };
        forEachPair(rowsOf(lattice, old, 0, place), isActive, [&](int to, int from, float weight) {
            if (!testBit(surface.inside[number], from)) weight *= static_cast<float>(kOutsideVoice);
            weights[to] += weight;
            const float* values = &field.features()[(number * std::size_t{kLeafVoxels} + from) * channels];
            for (std::size_t c = 0; c < channels; ++c) means[to * channels + c] += weight * values[c];
        });
    });
    for (int voxel = 0; voxel < kLeafVoxels; ++voxel)
        for (std::size_t c = 0; c < channels; ++c)
            if (weights[voxel] > 0) means[voxel * channels + c] /= weights[voxel];
}

// --- finer
// ---------------------------------------------------------------------------------------------------------

/// The old voxels around a new leaf's cells.
class Neighbourhood {
public:
    Neighbourhood(const Surface& surface, const Lattice& lattice, const Vec3i& new_leaf) {
        for (int axis = 0; axis < 3; ++axis)
            first_[axis] = static_cast<int>(std::floor(lattice.oldFromNew(new_leaf[axis] * kLeafDim)));
        const Topology& topology = surface.field.topology();
        Vec3i step;
        for (step.x() = 0; step.x() < kSide; ++step.x())
            for (step.y() = 0; step.y() < kSide; ++step.y())
                for (step.z() = 0; step.z() < kSide; ++step.z()) {
                    const Vec3i voxel = first_ + step;
                    const int leaf = topology.findLeaf(voxel.unaryExpr([](int i) { return i >> 3; }));
                    const int offset = brickOffset(voxel.x() & 7, voxel.y() & 7, voxel.z() & 7);
                    const bool is_active = leaf >= 0 && testBit(topology.voxels()[leaf], offset);
                    const float raw = is_active
                                          ? surface.field.density()[leaf * std::size_t{kLeafVoxels} + offset]
                                          : kEmptyRaw;
                    raw_[place(step)] = raw;
                    is_inside_[place(step)] = raw >= surface.iso;
                }
    }

    /// Whether an old voxel of the box [low, high] is inside.
    bool anyInside(const Vec3i& low, const Vec3i& high) const {
        for (int x = low.x(); x <= high.x(); ++x)
            for (int y = low.y(); y <= high.y(); ++y)
                for (int z = low.z(); z <= high.z(); ++z)
                    if (is_inside_[place(Vec3i(x, y, z) - first_)]) return true;
        return false;
    }

    float rawAt(const Vec3d& old_index) const {
        const Vec3d low = old_index.array().floor();
        const Vec3f u = (old_index - low).cast<float>();
        const float* const corner = &raw_[place(low.cast<int>() - first_)];
        const auto along = [&](int at) { return (1 - u.z()) * corner[at] + u.z() * corner[at + 1]; };
        const auto across = [&](int at) { return (1 - u.y()) * along(at) + u.y() * along(at + kSide); };
        return (1 - u.x()) * across(0) + u.x() * across(kSide * kSide);
    }

private:
    // Nine new voxels span at most eight old ones, from anywhere between two, and the last needs one more.
    static constexpr int kSide = 11;
    static std::size_t place(const Vec3i& step) { return (step.x() * kSide + step.y()) * kSide + step.z(); }

    Vec3i first_;
    std::array<float, kSide * kSide * kSide> raw_;
    std::array<bool, kSide * kSide * kSide> is_inside_;
};

Vec3d oldIndex(const Lattice& lattice, const Vec3i& voxel) {
    return {lattice.oldFromNew(voxel.x()), lattice.oldFromNew(voxel.y()), lattice.oldFromNew(voxel.z())};
}

Vec3i voxelOf(const Vec3i& leaf, int offset) {
    return leaf * kLeafDim + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
}

}  // namespace

VoxelField coarserField(const Surface& surface, double voxel_size, bool with_features) {
    const Lattice lattice(surface.field, voxel_size);
    const std::vector<Block> blocks = measureBlocks(surface);
    const auto find = [&](const Vec3i& place) -> const Block* {
        const auto block =
            std::lower_bound(blocks.begin(), blocks.end(), place,
                             [](const Block& b, const Vec3i& p) { return isBefore(b.place, p); });
        return block != blocks.end() && block->place == place ? &*block : nullptr;
    };
    std::vector<Vec3i> leaves;
    for (const Block& block : blocks) {
        const Vec3d low = (block.place * kLeafDim).cast<double>();
        addLeaves(lattice, low, low + Vec3d::Constant(kLeafDim), leaves);
    }
    sortUnique(leaves);

    // Cells that hold the middle of an old one with something inside: their corners are the voxels that hear of
    // it.
    const auto cellsOf = [&](const Vec3i& leaf) {
        LeafMask cells{};
        forEachOldLeaf(lattice, leaf, [&](const Vec3i& old) {
            const Block* const block = find(old);
            if (!block) return;
            const std::array<Row, 3> rows = rowsOf(lattice, old, 0.5, leaf);
            for (int offset = 0; offset < kLeafVoxels; ++offset) {
                const int x = rows[0].base[offset >> 6], y = rows[1].base[offset >> 3 & 7],
                          z = rows[2].base[offset & 7];
                if (block->share[offset] > 0 && !((x | y | z) & ~7)) setBit(cells, brickOffset(x, y, z));
            }
        });
        return cells;
    };
    VoxelField result(topologyOf(lattice, leaves, cellsOf), lattice.frame,
                      with_features ? surface.field.channels() : 0, surface.field.densityScale());
    parallelFor(result.topology().leafCount(), [&](std::size_t leaf) {
        const Vec3i place = result.topology().leafCoords()[leaf];
        std::array<double, kLeafVoxels> sums{};
        forEachOldLeaf(lattice, place, [&](const Vec3i& old) {
            const Block* const block = find(old);
            if (!block) return;
            forEachPair(
                rowsOf(lattice, old, 0.5, place), [&](int offset) { return block->share[offset] > 0; },
                [&](int to, int from, float weight) {
                    sums[to] += static_cast<double>(weight) * block->share[from];
                });
        });
        const auto x = tentSums(lattice, place.x()), y = tentSums(lattice, place.y()),
                   z = tentSums(lattice, place.z());
        forEachBit(result.topology().voxels()[leaf], [&](int offset) {
            const double share = sums[offset] / (x[offset >> 6] * y[offset >> 3 & 7] * z[offset & 7]);
            result.density()[leaf * kLeafVoxels + offset] =
                static_cast<float>(surface.iso + distanceOfShare(share) * (surface.iso - kEmptyRaw));
        });
        if (result.channels() > 0) meanFeatures(surface, lattice, leaf, result);
    });
    return result;
}

VoxelField finerField(const Surface& surface, double voxel_size) {
    const Lattice lattice(surface.field, voxel_size);
    const Topology& topology = surface.field.topology();
    std::vector<Vec3i> leaves;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf) {
        if (surface.inside[leaf] == LeafMask{}) continue;
        const Vec3d low = (topology.leafCoords()[leaf] * kLeafDim).cast<double>();
        addLeaves(lattice, low - Vec3d::Ones(), low + Vec3d::Constant(kLeafDim), leaves);
    }
    sortUnique(leaves);

    const auto cellsOf = [&](const Vec3i& leaf) {
        const Neighbourhood old(surface, lattice, leaf);
        LeafMask cells{};
        for (int offset = 0; offset < kLeafVoxels; ++offset) {
            const Vec3i cell = voxelOf(leaf, offset);
            const Vec3d low = oldIndex(lattice, cell), high = oldIndex(lattice, cell + Vec3i::Ones());
            if ((cell.array() < lattice.dims.array() - 1).all() &&
                old.anyInside(low.array().floor().cast<int>(), high.array().ceil().cast<int>()))
                setBit(cells, offset);
        }
        return cells;
    };
    VoxelField result(topologyOf(lattice, leaves, cellsOf), lattice.frame, 0, surface.field.densityScale());
    parallelFor(result.topology().leafCount(), [&](std::size_t leaf) {
        const Vec3i place = result.topology().leafCoords()[leaf];
        const Neighbourhood old(surface, lattice, place);
        forEachBit(result.topology().voxels()[leaf], [&](int offset) {
            result.density()[leaf * kLeafVoxels + offset] =
                old.rawAt(oldIndex(lattice, voxelOf(place, offset)));
        });
    });
    return result;
}

}  // namespace nerfvdb
