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

/// Leaves of a field that belong to one shell.
std::vector<std::size_t> leavesOf(const VoxelField& field, int shell) {
    std::vector<std::size_t> leaves;
    for (std::size_t leaf = 0; leaf < field.topology().leafCount(); ++leaf)
        if (field.shells().shellOf(field.topology().leafCoords()[leaf].x() * kLeafDim) == shell) leaves.push_back(leaf);
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

/// A field in the index space of the box that its inner shells become.
class ShellsInBox {
public:
    ShellsInBox(const VoxelField& field, int shells)
        : field_(field), shells_(field.shells()), count_(shells), edge_(shells_.extent * (1 << (shells - 1))) {}

    const Vec3i& edge() const { return edge_; }  // cells along each axis

    GridFrame frame() const {
        GridFrame frame = field_.frame();
        frame.origin -= 0.5 * frame.voxel_size * (edge_ - shells_.extent).cast<double>();
        return frame;
    }
    /// Lowest corner of a shell's box.
    Vec3i cornerOf(int shell) const { return (edge_ - shells_.extent * (1 << shell)) / 2; }

    std::vector<Topology::LeafCells> cells() const {
        CellMarks marks;
        for (int shell = 0; shell < count_; ++shell)
            for (const std::size_t leaf : leavesOf(field_, shell)) {
                const Vec3i first = field_.topology().leafCoords()[leaf] * kLeafDim - Vec3i(shell * shells_.stride, 0, 0);
                forEachBit(field_.topology().cells()[leaf], [&](int offset) {
                    marks.add(cornerOf(shell) + (first + voxelIn(offset)) * (1 << shell), 1 << shell);
                });
            }
        return marks.take();
    }

    /// Reads raw density and features [channels] at a corner of one of cells(), of the finest shell that has it.
    void read(const Vec3i& voxel, float& raw, float* features) const {
        for (int shell = 0; shell < count_; ++shell)
            if (readFrom(shell, voxel, raw, features)) return;
    }

private:
    /// False where no cell of the shell has the place in it or on its border.
    bool readFrom(int shell, const Vec3i& voxel, float& raw, float* features) const {
        const Vec3i local = voxel - cornerOf(shell);
        if ((local.array() < 0).any() || (local.array() > shells_.extent.array() * (1 << shell)).any()) return false;
        const int part = (1 << shell) - 1;
        Vec3i low = local.unaryExpr([&](int i) { return i >> shell; });
        const Vec3f u = local.unaryExpr([&](int i) { return i & part; }).cast<float>() / static_cast<float>(1 << shell);
        low.x() += shell * shells_.stride;
        if (!isInCell(low, u)) return false;

        const Topology& topology = field_.topology();
        const auto channels = static_cast<std::size_t>(field_.channels());
        raw = 0;
        std::fill_n(features, channels, 0.0f);
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
            float weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
            if (weight == 0) continue;
            const Vec3i at = low + step;
            const std::size_t from = static_cast<std::size_t>(topology.findLeaf(at / kLeafDim)) * kLeafVoxels +
                                     brickOffset(at.x() & 7, at.y() & 7, at.z() & 7);
            raw += weight * field_.density()[from];
            for (std::size_t c = 0; c < channels; ++c) features[c] += weight * field_.features()[from * channels + c];
        }
        // The activation's clamp comes first: what is opaque in one shell is so in the other.
        if (shell > 0) raw = std::min(raw, kMaxRaw) - static_cast<float>(shell) * std::numbers::ln2_v<float>;
        return true;
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
    Shells shells_;
    int count_;
    Vec3i edge_;
};

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
    for (int shell = 0; shell < shells; ++shell) {
        const double parts = std::ldexp(1.0, 3 * shell);
        double cells = 0;
        const std::vector<std::size_t> own = leavesOf(field, shell);
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

    const ShellsInBox box(field, shells);
    VoxelField flat(Topology(dimsFor(box.edge()), box.cells()), box.frame(), field.channels(), field.densityScale());
    const auto channels = static_cast<std::size_t>(field.channels());
    const Topology& topology = flat.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        forEachBit(topology.voxels()[leaf], [&](int offset) {
            const std::size_t to = leaf * kLeafVoxels + offset;
            box.read(topology.leafCoords()[leaf] * kLeafDim + voxelIn(offset), flat.density()[to],
                     &flat.features()[to * channels]);
        });
    });
    return withField(model, std::move(flat));
}

Model shellModel(const Model& model, int shell) {
    const VoxelField& field = model.field;
    checkShells(field, shell + 1);
    if (field.shells().count == 1) return withField(model, copyField(field, field.topology()));
    const Vec3i shift(shell * field.shells().stride / kLeafDim, 0, 0);
    std::vector<Topology::LeafCells> cells;
    for (const std::size_t leaf : leavesOf(field, shell))
        cells.push_back({field.topology().leafCoords()[leaf] - shift, field.topology().cells()[leaf]});
    GridFrame frame = field.shells().frame(field.frame(), shell);
    frame.origin = frame.worldFromIndex(field.shells().corner(shell));
    VoxelField alone(Topology(dimsFor(field.shells().extent), cells), frame, field.channels(),
                     field.densityScale() / Shells::scale(shell));
    const auto channels = static_cast<std::size_t>(field.channels());
    const Topology& topology = alone.topology();
    parallelFor(topology.leafCount(), [&](std::size_t leaf) {
        const auto from = static_cast<std::size_t>(field.topology().findLeaf(topology.leafCoords()[leaf] + shift));
        std::copy_n(&field.density()[from * kLeafVoxels], kLeafVoxels, &alone.density()[leaf * kLeafVoxels]);
        std::copy_n(&field.features()[from * kLeafVoxels * channels], kLeafVoxels * channels,
                    &alone.features()[leaf * kLeafVoxels * channels]);
    });
    return withField(model, std::move(alone));
}

}  // namespace nerfvdb
