// SPDX-License-Identifier: Apache-2.0
#include "export/flat_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

Vec3i voxelIn(int offset) { return {offset >> 6, offset >> 3 & 7, offset & 7}; }

/// All of a model but its field; the sky belongs to what lies outside.
Model withField(const Model& model, VoxelField field) {
    Model made;
    made.field = std::move(field);
    made.decoder = model.decoder;
    made.background = model.background;
    made.info = model.info;
    made.cameras = model.cameras;
    return made;
}

/// Leaves of a field that belong to one layer.
std::vector<std::size_t> leavesOf(const VoxelField& field, int layer) {
    std::vector<std::size_t> leaves;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        if (field.shells().layerAt(field.topology().leafCoords()[leaf].x() * kLeafDim) == layer) leaves.push_back(leaf);
    return leaves;
}

std::size_t cellCount(const LeafMask& mask) {
    std::size_t n = 0;
    forEachBit(mask, [&](int) { ++n; });
    return n;
}

/// Voxels of a box of `extent` cells, in whole leaves.
Vec3i dimsFor(const Vec3i& extent) {
    return (extent + Vec3i::Constant(kLeafDim)) / kLeafDim * kLeafDim;
}

std::string gigabytes(double bytes) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f GB", bytes / 1e9);
    return text;
}

std::string sizeText(const FlatSize& size) {
    char text[64];
    std::snprintf(text, sizeof text, "about %.0f million voxels and ", std::ceil(size.cells / 1e6));
    return text + gigabytes(size.bytes);
}

/// Marks cells anywhere in a box of leaves.
class CellMarks {
public:
    /// A cube of `edge` cells.
    void add(const Vec3i& first, int edge) {
        for (Vec3i at = first; at.x() < first.x() + edge; ++at.x())
            for (at.y() = first.y(); at.y() < first.y() + edge; ++at.y())
                for (at.z() = first.z(); at.z() < first.z() + edge; ++at.z())
                    setBit(leafAt(at / kLeafDim), brickOffset(at.x() & 7, at.y() & 7, at.z() & 7));
    }
    std::vector<Topology::LeafCells> take() { return std::move(entries_); }

private:
    LeafMask& leafAt(const Vec3i& leaf) {
        if (!entries_.empty() && entries_[last_].leaf == leaf) return entries_[last_].cells;
        const std::uint64_t key = (static_cast<std::uint64_t>(leaf.x()) << 42) |
                                  (static_cast<std::uint64_t>(leaf.y()) << 21) | static_cast<std::uint64_t>(leaf.z());
        const auto [found, is_new] = number_.try_emplace(key, entries_.size());
        if (is_new) entries_.push_back({leaf, {}});
        last_ = found->second;
        return entries_[last_].cells;
    }

    std::vector<Topology::LeafCells> entries_;
    std::unordered_map<std::uint64_t, std::size_t> number_;
    std::size_t last_ = 0;
};

/// A value at a place: raw density, as voxels of the box have it, and features.
struct FlatValue {
    float* raw;
    float* features;  // [channels]
};

/// Some shells of a field, one after the other, in the index space of the box that they become, in the first one's voxels.
class ShellsInBox {
public:
    ShellsInBox(const VoxelField& field, int first, int count)
        : field_(field), shells_(field.shells()), first_(first), edge_(shells_.extent * (1 << (count - 1))),
          density_scale_(field.densityScale() / Shells::scale(first)) {
        for (int layer = 0; layer < shells_.layerCount(); ++layer)
            if (const int shell = shells_.shellOf(layer); shell >= first && shell < first + count) layers_.push_back(layer);
        std::stable_sort(layers_.begin(), layers_.end(), [&](int a, int b) { return doublingsOf(a) < doublingsOf(b); });
    }

    const Vec3i& edge() const { return edge_; }  // cells along each axis
    double densityScale() const { return density_scale_; }

    GridFrame frame() const {
        GridFrame frame = shells_.frame(field_.frame(), first_);
        const Vec3d margin = 0.5 * (edge_ - shells_.extent).cast<double>();  // around the first shell
        frame.origin = frame.worldFromIndex(shells_.corner(first_).cast<double>() - margin);
        return frame;
    }

    std::vector<Topology::LeafCells> cells() const {
        CellMarks marks;
        for (const int layer : layers_)
            for (const std::size_t leaf : leavesOf(field_, layer)) {
                const Vec3i begin = field_.topology().leafCoords()[leaf] * kLeafDim - shells_.corner(layer);
                const int doublings = doublingsOf(layer);
                forEachBit(field_.topology().cells()[leaf], [&](int offset) {
                    const Vec3i cell = begin + voxelIn(offset);
                    marks.add(cornerOf(layer) + (doublings < 0 ? halved(cell, -doublings) : Vec3i(cell * (1 << doublings))),
                              1 << std::max(doublings, 0));
                });
            }
        return marks.take();
    }

    /// Reads the value at a corner of one of cells(), of the layer with the smallest voxels that has it.
    void read(const Vec3i& voxel, const FlatValue& value) const {
        for (const int layer : layers_)
            if (doublingsOf(layer) < 0 ? readMean(layer, voxel, 1, value) : readBetween(layer, voxel, value)) return;
        // Nothing is within the voxel's own cube: colours come from next to it.
        for (const int layer : layers_)
            if (doublingsOf(layer) < 0 && readMean(layer, voxel, 2, value)) break;
        *value.raw = kEmptyRaw;
    }

private:
    /// How often the box's voxels would have to be doubled to be as large as a layer's.
    int doublingsOf(int layer) const { return shells_.shellOf(layer) - first_ - shells_.halvingsOf(layer); }
    static Vec3i halved(const Vec3i& v, int times) {
        return v.unaryExpr([&](int i) { return i >> times; });
    }
    /// Lowest corner of the box of a layer's shell.
    Vec3i cornerOf(int layer) const { return (edge_ - shells_.extent * (1 << (shells_.shellOf(layer) - first_))) / 2; }

    /// Of a layer with voxels as large or larger: false where no cell of it has the place in it or on its border.
    bool readBetween(int layer, const Vec3i& voxel, const FlatValue& value) const {
        const int doublings = doublingsOf(layer);
        const Vec3i local = voxel - cornerOf(layer);
        if ((local.array() < 0).any() || (local.array() > shells_.extentOf(layer).array() * (1 << doublings)).any())
            return false;
        const int part = (1 << doublings) - 1;
        const Vec3f u = local.unaryExpr([&](int i) { return i & part; }).cast<float>() / static_cast<float>(1 << doublings);
        const Vec3i low = halved(local, doublings) + shells_.corner(layer);
        if (!isInCell(low, u)) return false;

        const Topology& topology = field_.topology();
        const auto channels = static_cast<std::size_t>(field_.channels());
        *value.raw = 0;
        std::fill_n(value.features, channels, 0.0f);
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
            float weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
            if (weight == 0) continue;
            const Vec3i at = low + step;
            const std::size_t from = static_cast<std::size_t>(topology.findLeaf(at / kLeafDim)) * kLeafVoxels +
                                     brickOffset(at.x() & 7, at.y() & 7, at.z() & 7);
            *value.raw += weight * field_.density()[from];
            for (std::size_t c = 0; c < channels; ++c) value.features[c] += weight * field_.features()[from * channels + c];
        }
        // The activation's clamp comes first: what is opaque in one layer is so in the other.
        if (doublings > 0)
            *value.raw = std::min(*value.raw, kMaxRaw) - static_cast<float>(doublings) * std::numbers::ln2_v<float>;
        return true;
    }

    /// Of a layer with smaller voxels: the mean of sigma over a cube `size` voxels wide, as far as the layer owns it, and of
    /// features by sigma; false where the layer has nothing there.
    bool readMean(int layer, const Vec3i& voxel, int size, const FlatValue& value) const {
        const int parts = 1 << -doublingsOf(layer), reach = size * parts / 2;
        const Vec3i center = (voxel - cornerOf(layer)) * parts;
        if ((center.array() < 0).any() || (center.array() > shells_.extentOf(layer).array()).any()) return false;
        // What hides more would still hide all where it fills a small part of the cube, and things would become fatter.
        constexpr double kOpaque = 10;  // optical depth of a voxel of the layer
        const double most = kOpaque / (field_.densityScale() * field_.frame().voxel_size);
        const auto channels = static_cast<std::size_t>(field_.channels());
        double volume = 0, sum = 0;
        bool is_any = false;
        std::fill_n(value.features, channels, 0.0f);
        for (int n = 0, side = 2 * reach + 1; n < side * side * side; ++n) {
            const Vec3i step(n / (side * side) - reach, n / side % side - reach, n % side - reach);
            const Vec3i at = center + step;
            if (!owns(layer, at)) continue;
            double weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= std::abs(step[axis]) == reach ? 0.5 : 1.0;
            volume += weight;
            const Vec3i index = at + shells_.corner(layer);
            const int leaf = field_.topology().findLeaf(index / kLeafDim);
            const int offset = brickOffset(index.x() & 7, index.y() & 7, index.z() & 7);
            if (leaf < 0 || !testBit(field_.topology().voxels()[leaf], offset)) continue;
            is_any = true;
            const std::size_t from = static_cast<std::size_t>(leaf) * kLeafVoxels + offset;
            const double sigma = weight * std::min(std::exp(static_cast<double>(field_.density()[from])), most);
            sum += sigma;
            for (std::size_t c = 0; c < channels; ++c)
                value.features[c] += static_cast<float>(sigma) * field_.features()[from * channels + c];
        }
        if (!is_any || !(static_cast<float>(sum) > 0)) return false;
        for (std::size_t c = 0; c < channels; ++c) value.features[c] /= static_cast<float>(sum);
        const double doublings = doublingsOf(layer);
        *value.raw = static_cast<float>(std::max<double>(std::log(sum / volume) - doublings * std::numbers::ln2, kEmptyRaw));
        return true;
    }

    /// Whether a place is in one of a layer's regions, where no smaller shell lies, or on its border.
    bool owns(int layer, const Vec3i& local) const {
        const Vec3i hole = shells_.extentOf(layer) / 4;
        for (int n = 0; n < 8; ++n) {
            const Vec3i cell = local - Vec3i(n >> 2 & 1, n >> 1 & 1, n & 1);
            if ((cell.array() < 0).any() || (cell.array() >= shells_.extentOf(layer).array()).any()) continue;
            if (shells_.shellOf(layer) > 0 && (cell.array() >= hole.array()).all() && (cell.array() < 3 * hole.array()).all())
                continue;
            const Vec3i region = shells_.regionOf(layer, cell + shells_.corner(layer), shells_.regions->dims);
            if (shells_.regions->at(shells_.shellOf(layer), region) == shells_.halvingsOf(layer)) return true;
        }
        return false;
    }

    /// Whether one of the up to eight cells that meet there exists; `u` says where in the cell `low`.
    bool isInCell(const Vec3i& low, const Vec3f& u) const {
        for (int n = 0; n < 8; ++n) {
            const Vec3i below(n >> 2 & 1, n >> 1 & 1, n & 1);
            if (((below.array() > 0) && (u.array() > 0)).any()) continue;
            const Vec3i cell = low - below;
            if ((cell.array() < 0).any()) continue;
            const int leaf = field_.topology().findLeaf(cell / kLeafDim);
            if (leaf >= 0 && testBit(field_.topology().cells()[leaf], brickOffset(cell.x() & 7, cell.y() & 7, cell.z() & 7)))
                return true;
        }
        return false;
    }

    const VoxelField& field_;
    const Shells& shells_;
    int first_;
    Vec3i edge_;
    double density_scale_;
    std::vector<int> layers_;  // smallest voxels first
};

Model boxOf(const Model& model, int first, int count) {
    const VoxelField& field = model.field;
    const ShellsInBox box(field, first, count);
    VoxelField flat(Topology(dimsFor(box.edge()), box.cells()), box.frame(), field.channels(), box.densityScale());
    const auto channels = static_cast<std::size_t>(field.channels());
    const Topology& topology = flat.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const std::size_t to = leaf * kLeafVoxels + offset;
            box.read(topology.leafCoords()[leaf] * kLeafDim + voxelIn(offset),
                     {&flat.density()[to], &flat.features()[to * channels]});
        });
    });
    return withField(model, std::move(flat));
}

void checkShells(const VoxelField& field, int shells) {
    if (shells < 1 || shells > field.shells().count)
        throw UsageError("--shells", std::to_string(shells), "1 to " + std::to_string(field.shells().count),
                         "'nerfvdb info MODEL' lists the shells of a model");
}

}  // namespace

FlatSize flatSize(const VoxelField& field, int shells) {
    checkShells(field, shells);
    FlatSize size;
    double leaves = 0;
    for (int layer = 0; layer < field.shells().layerCount(); ++layer) {
        if (field.shells().shellOf(layer) >= shells) continue;
        const int doublings = field.shells().shellOf(layer) - field.shells().halvingsOf(layer);
        const double parts = std::ldexp(1.0, 3 * std::max(doublings, 0));
        double cells = 0;
        const std::vector<std::size_t> own = leavesOf(field, layer);
        for (const std::size_t leaf : own) cells += static_cast<double>(cellCount(field.topology().cells()[leaf]));
        size.cells += parts * cells;
        // A leaf becomes 8^k, of which those without a cell are left away; a cell fills at most that many.
        leaves += std::min(parts * static_cast<double>(own.size()), cells * std::max(parts / kLeafVoxels, 1.0));
    }
    const double places = (dimsFor(field.shells().extent).cast<double>() * Shells::scale(shells - 1) / kLeafDim).prod();
    size.bytes = leaves * kLeafVoxels * sizeof(float) * (1 + field.channels()) + places * sizeof(std::int32_t);
    return size;
}

Model flatModel(const Model& model, int shells, double max_bytes) {
    const VoxelField& field = model.field;
    const FlatSize size = flatSize(field, shells);
    if (field.shells().count == 1) return withField(model, copyField(field, field.topology()));
    if (size.bytes > max_bytes)
        throw UsageError("--shells", std::to_string(shells) + ", in voxels of the inner one " + sizeText(size),
                         "at most " + gigabytes(max_bytes),
                         "take fewer shells, or export each in its own voxels with --each-shell");

    return boxOf(model, 0, shells);
}

Model shellModel(const Model& model, int shell) {
    const VoxelField& field = model.field;
    checkShells(field, shell + 1);
    if (field.shells().count == 1) return withField(model, copyField(field, field.topology()));
    return boxOf(model, shell, 1);
}

}  // namespace nerfvdb
