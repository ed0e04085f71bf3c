// SPDX-License-Identifier: Apache-2.0
#include "bench/unskipped.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "vdb/adapt.h"

namespace nerfvdb {
namespace {

bool isEmpty(const LeafMask& mask) {
    return std::all_of(mask.begin(), mask.end(), [](std::uint64_t word) { return word == 0; });
}

/// All cells of a leaf that end inside the box.
LeafMask wholeLeaf(const Vec3i& leaf, const Vec3i& dims) {
    LeafMask mask{};
    const Vec3i left = dims - Vec3i::Ones() - leaf * kLeafDim;  // cells before the border, per axis
    for (int x = 0; x < std::min(kLeafDim, left.x()); ++x)
        for (int y = 0; y < std::min(kLeafDim, left.y()); ++y)
            for (int z = 0; z < std::min(kLeafDim, left.z()); ++z) setBit(mask, brickOffset(x, y, z));
    return mask;
}

/// A leaf coordinate such that neither it nor any of the seven above it exists in either; nothing if there is
/// none.
std::optional<Vec3i> lonelyPlace(const Topology& a, const Topology& b) {
    const Vec3i leaves = a.dims() / kLeafDim;
    for (int x = 0; x + 1 < leaves.x(); ++x)
        for (int y = 0; y + 1 < leaves.y(); ++y)
            for (int z = 0; z + 1 < leaves.z(); ++z) {
                bool is_free = true;
                for (int c = 0; c < 8 && is_free; ++c) {
                    const Vec3i leaf(x + (c >> 2), y + (c >> 1 & 1), z + (c & 1));
                    is_free = a.findLeaf(leaf) < 0 && b.findLeaf(leaf) < 0;
                }
                if (is_free) return Vec3i(x, y, z);
            }
    return std::nullopt;
}

/// Puts a leaf's number where there is none: nothing is jumped any more.
void fillEmpty(LeafTable& skip, std::int32_t leaf_number) {
    for (int x = 0; x < skip.node_dims.x(); ++x)
        for (int y = 0; y < skip.node_dims.y(); ++y)
            for (int z = 0; z < skip.node_dims.z(); ++z) skip.touch(kNodeDim * Vec3i(x, y, z));
    for (std::int32_t& entry : skip.leaves)
        if (entry < 0) entry = leaf_number;
}

}  // namespace

Unskipped::Unskipped(const Model& model, float min_alpha)
    : model_(model), occupancy_(findOccupied(model.field, min_alpha)) {
    const Topology& topology = model.field.topology();
    std::vector<Topology::LeafCells> cells;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        if (!isEmpty(occupancy_.cells[leaf]))
            cells.push_back(
                {topology.leafCoords()[leaf], wholeLeaf(topology.leafCoords()[leaf], topology.dims())});
    Topology whole(topology.dims(), cells);
    const std::optional<Vec3i> place = lonelyPlace(whole, topology);
    if (place) {
        cells.push_back({*place, wholeLeaf(*place, topology.dims())});
        whole = Topology(topology.dims(), cells);
        empty_leaf_ = whole.findLeaf(*place);
    }
    full_.field = copyField(model.field, std::move(whole));
    full_.decoder = model.decoder;
    full_.background = model.background;
    full_.sky = model.sky;
}

Occupancy Unskipped::walkedLeaves() const {
    Occupancy walked = occupancy_;
    // A leaf number behind the last, with no bit set: the march looks it up and finds nothing.
    const auto nothing = static_cast<std::int32_t>(walked.cells.size());
    walked.cells.push_back({});
    fillEmpty(walked.skip, nothing);
    return walked;
}

Occupancy Unskipped::wholeLeaves() const {
    const Topology& topology = full_.field.topology();
    std::vector<LeafMask> cells(topology.cells().begin(), topology.cells().end());
    if (empty_leaf_ >= 0) cells[static_cast<std::size_t>(empty_leaf_)] = {};
    return occupancyFromCells(topology, std::move(cells));
}

std::optional<Occupancy> Unskipped::wholeBox() const {
    if (empty_leaf_ < 0) return std::nullopt;
    const Topology& topology = full_.field.topology();
    Occupancy dense = occupancyFromCells(topology, {topology.cells().begin(), topology.cells().end()});
    fillEmpty(dense.skip, empty_leaf_);
    return dense;
}

void aimAtWholeBox(RaySource& source, const VoxelField& field) {
    // One leaf as large as the box: the source takes the pixels that its bounding sphere covers.
    const Box box = field.worldBox();
    const double edge = box.size().maxCoeff();
    LeafMask first{};
    setBit(first, 0);
    const Topology::LeafCells cell{Vec3i::Zero(), first};
    const GridFrame frame{box.center() - Vec3d::Constant(0.5 * edge), edge / kLeafDim};
    const VoxelField giant(Topology(Vec3i::Constant(kLeafDim), {&cell, 1}), frame, field.channels(),
                           field.densityScale());
    source.update(giant, occupancyFromCells(giant.topology(), {giant.topology().cells().begin(),
                                                               giant.topology().cells().end()}));
}

}  // namespace nerfvdb
