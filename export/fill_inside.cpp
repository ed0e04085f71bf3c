// SPDX-License-Identifier: Apache-2.0
#include "export/fill_inside.h"

namespace nerfvdb {
namespace {

constexpr std::uint64_t kFirstZ = 0x0101010101010101;  // bits of a word with z == 0
constexpr std::uint64_t kFirstY = 0xff;

LeafMask fullMask() {
    LeafMask mask;
    mask.fill(~std::uint64_t{0});
    return mask;
}

/// Grows voxels of one x to all that paths through `open`, at the same x, join to them.
std::uint64_t floodWord(std::uint64_t reached, std::uint64_t open) {
    for (std::uint64_t before = 0; before != reached;) {
        before = reached;
        reached |=
            (reached << 8 | reached >> 8 | (reached & ~(kFirstZ << 7)) << 1 | (reached & ~kFirstZ) >> 1) & open;
    }
    return reached;
}

/// The same in a whole leaf: sweeps up and down the x axis until nothing is new.
LeafMask floodLeaf(LeafMask reached, const LeafMask& open) {
    for (LeafMask before{}; before != reached;) {
        before = reached;
        for (int x = 0; x < kLeafWords; ++x)
            reached[x] = floodWord(reached[x] | (x > 0 ? reached[x - 1] & open[x] : 0), open[x]);
        for (int x = kLeafWords - 2; x >= 0; --x)
            reached[x] = floodWord(reached[x] | (reached[x + 1] & open[x]), open[x]);
    }
    return reached;
}

/// The neighbours, in the next leaf along `axis`, of a leaf's voxels; `up`: the leaf after it, not before.
LeafMask stepOver(const LeafMask& mask, int axis, bool up) {
    LeafMask next{};
    if (axis == 0) {
        next[up ? 0 : kLeafWords - 1] = mask[up ? kLeafWords - 1 : 0];
        return next;
    }
    for (int x = 0; x < kLeafWords; ++x) {
        if (axis == 1)
            next[x] = up ? mask[x] >> 56 : (mask[x] & kFirstY) << 56;
        else
            next[x] = up ? mask[x] >> 7 & kFirstZ : (mask[x] & kFirstZ) << 7;
    }
    return next;
}

/// Everything that paths from beyond the box reach. A set does not depend on the order in which it is found.
class Outside {
public:
    explicit Outside(const Surface& surface)
        : surface_(surface),
          topology_(surface.field.topology()),
          reached_(topology_.leafCount(), LeafMask{}),
          absent_(topology_.dims()) {
        enterFromBeyond();
        while (!waiting_.empty()) {
            const Vec3i leaf = waiting_.back();
            waiting_.pop_back();
            leave(leaf);
        }
    }

    const std::vector<LeafMask>& reached() const { return reached_; }  // [leaf]
    const LeafSet& absent() const { return absent_; }                  // places without a leaf, reached

private:
    void enterFromBeyond() {
        const Vec3i leaves = topology_.dims() / kLeafDim;
        for (int axis = 0; axis < 3; ++axis) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            Vec3i leaf;
            for (leaf[u] = 0; leaf[u] < leaves[u]; ++leaf[u])
                for (leaf[v] = 0; leaf[v] < leaves[v]; ++leaf[v])
                    for (const bool up : {true, false}) {
                        leaf[axis] = up ? 0 : leaves[axis] - 1;
                        enter(leaf, stepOver(fullMask(), axis, up));
                    }
        }
    }

    /// Takes in voxels of a leaf that are reached, or would be if they were below iso.
    void enter(const Vec3i& leaf, const LeafMask& voxels) {
        const int number = topology_.findLeaf(leaf);
        if (number < 0) {
            if (voxels != LeafMask{} && absent_.insert(leaf)) waiting_.push_back(leaf);
            return;
        }
        bool is_new = false;
        for (int x = 0; x < kLeafWords; ++x) {
            const std::uint64_t bits = voxels[x] & ~surface_.inside[number][x] & ~reached_[number][x];
            reached_[number][x] |= bits;
            is_new |= bits != 0;
        }
        if (is_new) waiting_.push_back(leaf);
    }

    /// Follows paths through a leaf and into its neighbours.
    void leave(const Vec3i& leaf) {
        LeafMask reached = fullMask();
        if (const int number = topology_.findLeaf(leaf); number >= 0) {
            LeafMask open;
            for (int x = 0; x < kLeafWords; ++x) open[x] = ~surface_.inside[number][x];
            reached = reached_[number] = floodLeaf(reached_[number], open);
        }
        for (int axis = 0; axis < 3; ++axis)
            for (const bool up : {true, false})
                enter(leaf + (up ? 1 : -1) * Vec3i::Unit(axis), stepOver(reached, axis, up));
    }

    const Surface& surface_;
    const Topology& topology_;
    std::vector<LeafMask> reached_;
    LeafSet absent_;
    std::vector<Vec3i> waiting_;  // leaves that were entered since they were last left
};

}  // namespace

std::size_t fillInside(Surface& surface) {
    const Topology& topology = surface.field.topology();
    const Outside outside(surface);
    std::size_t n_filled = 0;
    for (std::size_t leaf = 0; leaf < topology.leafCount(); ++leaf)
        for (int x = 0; x < kLeafWords; ++x) {
            const std::uint64_t solid = ~outside.reached()[leaf][x];
            n_filled += std::popcount(solid & ~surface.inside[leaf][x]);
            surface.inside[leaf][x] = solid;
        }

    surface.is_filled = true;
    surface.enclosed = LeafSet(topology.dims());
    const Vec3i leaves = topology.dims() / kLeafDim;
    Vec3i leaf;
    for (leaf.x() = 0; leaf.x() < leaves.x(); ++leaf.x())
        for (leaf.y() = 0; leaf.y() < leaves.y(); ++leaf.y())
            for (leaf.z() = 0; leaf.z() < leaves.z(); ++leaf.z())
                if (topology.findLeaf(leaf) < 0 && !outside.absent().contains(leaf)) {
                    surface.enclosed.insert(leaf);
                    n_filled += kLeafVoxels;
                }
    return n_filled;
}

}  // namespace nerfvdb
