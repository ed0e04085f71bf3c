// SPDX-License-Identifier: Apache-2.0
// The proof that surfaces hold water: thousands of random sparse fields, made so that everything that can go
// wrong at a voxel, a face, a leaf's border or a tile's does occur, and what must hold for each of their
// meshes.
#include <algorithm>
#include <functional>
#include <queue>
#include <set>

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "export/marching_cubes.h"
#include "export/surface_cells.h"
#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/meshing.h"

using namespace nerfvdb;
using namespace nerfvdb::test;

namespace {

/// Random numbers in order, for tests only.
struct Dice {
    std::uint64_t seed;
    std::uint64_t n = 0;
    float unit() { return unitFloat(static_cast<std::uint32_t>(randomBits(seed, 0, n++) >> 32)); }
    float between(float low, float high) { return low + (high - low) * unit(); }
    int below(int n_values) { return std::min(static_cast<int>(unit() * n_values), n_values - 1); }
};

using Value = std::function<float(const Vec3i&)>;  // of any voxel; inside: >= 0

/// Pieces into which the inside corners of a cell of any dimension fall. `free` holds the axes along which it
/// extends, as steps of cornerStep's numbers. Corners hang together along edges, and across a face whose
/// corners alternate if the saddle of its bilinear field is inside.
int insidePieces(const std::array<double, 8>& value, int base, const std::vector<int>& free) {
    std::vector<int> corners = {base};
    for (const int step : free)
        for (std::size_t i = 0, n = corners.size(); i < n; ++i) corners.push_back(corners[i] + step);
    std::array<int, 8> piece{0, 1, 2, 3, 4, 5, 6, 7};
    const auto isInside = [&](int c) { return value[c] >= 0; };
    const auto join = [&](int a, int b) {
        const int from = piece[a], to = piece[b];
        for (int& p : piece) p = p == from ? to : p;
    };
    for (const int c : corners)
        for (std::size_t i = 0; i < free.size(); ++i) {
            if ((c & free[i]) != (base & free[i])) continue;
            if (isInside(c) && isInside(c + free[i])) join(c, c + free[i]);
            for (std::size_t j = i + 1; j < free.size(); ++j) {
                if ((c & free[j]) != (base & free[j])) continue;
                const int ring[4] = {c, c + free[i], c + free[i] + free[j], c + free[j]};
                const int first = isInside(ring[0]) ? 0 : 1;
                if (!isInside(ring[first]) || !isInside(ring[first + 2]) || isInside(ring[1 - first]) ||
                    isInside(ring[3 - first]))
                    continue;
                // With a, c inside and b, d outside the saddle (a c - b d) / (a + c - b - d) has the
                // numerator's sign.
                const double inner = value[ring[first]] * value[ring[first + 2]];
                const double outer = value[ring[1 - first]] * value[ring[3 - first]];
                if (inner >= outer) join(ring[first], ring[first + 2]);
            }
        }
    std::set<int> roots;
    for (const int c : corners)
        if (isInside(c)) roots.insert(piece[c]);
    return static_cast<int>(roots.size());
}

/// Euler characteristic of the surface, from the values alone: twice that of the solid which it encloses, as
/// for every closed surface in space. The solid is the union of its parts in the grid's cubes. No tunnel runs
/// through a cube, so that a part is a ball for each piece of inside corners; and parts meet in discs on faces,
/// segments on edges, and voxels. So by inclusion and exclusion it is
///   pieces in cubes - pieces in faces + pieces in edges - voxels inside,
/// summed over the cells whose lowest corner lies in [low, high). Everything else must be outside.
std::int64_t eulerOfValues(const Value& valueAt, const Vec3i& low, const Vec3i& high) {
    std::int64_t solid = 0;
    for (int x = low.x(); x < high.x(); ++x)
        for (int y = low.y(); y < high.y(); ++y)
            for (int z = low.z(); z < high.z(); ++z) {
                std::array<double, 8> value;
                bool any = false;
                for (int c = 0; c < 8; ++c) {
                    value[c] = valueAt(Vec3i(x, y, z) + cornerStep(c));
                    any |= value[c] >= 0;
                }
                if (!any) continue;
                solid += insidePieces(value, 0, {4, 2, 1});
                solid -= insidePieces(value, 0, {4, 2}) + insidePieces(value, 0, {4, 1}) +
                         insidePieces(value, 0, {2, 1});
                solid +=
                    insidePieces(value, 0, {4}) + insidePieces(value, 0, {2}) + insidePieces(value, 0, {1});
                solid -= value[0] >= 0;
            }
    return 2 * solid;
}

/// What fill_inside.h promises, voxel by voxel: outside is what a path over faces, below iso, joins to beyond
/// the box.
std::vector<bool> reachedFromBeyond(const Value& valueAt, const Vec3i& low, const Vec3i& high) {
    const Vec3i n = high - low;
    const auto place = [&](const Vec3i& p) {
        return (static_cast<std::size_t>(p.x() - low.x()) * n.y() + p.y() - low.y()) * n.z() + p.z() - low.z();
    };
    std::vector<bool> reached(n.cast<std::size_t>().prod(), false);
    std::queue<Vec3i> open;
    const auto enter = [&](const Vec3i& p) {
        if ((p.array() < low.array()).any() || (p.array() >= high.array()).any()) return;
        if (reached[place(p)] || valueAt(p) >= 0) return;
        reached[place(p)] = true;
        open.push(p);
    };
    enter(low);  // beyond the box
    while (!open.empty()) {
        const Vec3i p = open.front();
        open.pop();
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1}) enter(p + step * Vec3i::Unit(axis));
    }
    return reached;
}

/// Kinds of values, each the worst case of something.
constexpr int kKinds = 7;
float randomRaw(Dice& dice, int kind, const Vec3i& p, float share_inside) {
    const bool is_inside = dice.unit() < share_inside;
    switch (kind) {
        case 0:
            return is_inside ? dice.between(0, 2) : dice.between(-2, -1e-6f);  // noise: every ambiguity
        case 1:
            return is_inside ? 0.0f : -1.0f;  // on the iso itself
        case 2:
            return p.x() % 2 ? 1.0f : dice.between(-2, 0.1f);  // sheets that nearly touch
        case 3:
            return is_inside ? 1.0f : -1.0f;  // every saddle a tie
        case 4:
            return is_inside ? dice.between(0, 1e-38f) : -dice.between(1e-38f, 1e14f);  // hardly and far
        case 5:  // walls and gaps along the borders of leaves
            return p.unaryExpr([](int i) { return (i & 7) % 7 == 0 ? 1 : 0; }).any() == is_inside
                       ? 1.0f
                       : dice.between(-1, 0.2f);
        default:  // smooth: large surfaces, saddles, necks
            return std::sin(0.7f * p.x() + share_inside) + std::sin(0.8f * p.y()) + std::sin(0.9f * p.z()) +
                   dice.between(-0.3f, 0.3f) + share_inside - 0.5f;
    }
}

}  // namespace

TEST_CASE("one cell with any signs and any values gives a closed oriented manifold", "[export]") {
    Dice dice{1};
    // The cell (7, 7, 7) has its corners in eight leaves; the others are one leaf's inner cell.
    for (const Vec3i& cell : {Vec3i(3, 3, 3), Vec3i(7, 7, 7)}) {
        Model model = modelOf(
            makeTopology(Vec3i(16, 16, 16), cell, cell + Vec3i::Ones(), [](const Vec3i&) { return true; }));
        for (int pattern = 1; pattern < 256; ++pattern)
            for (int round = 0; round < 4; ++round) {
                setDensity(model.field, [&](const Vec3i& ijk) {
                    const Vec3i c = ijk - cell;
                    const bool is_inside = pattern >> (c.x() * 4 + c.y() * 2 + c.z()) & 1;
                    return is_inside ? dice.between(0, 3) : dice.between(-3, -1e-6f);
                });
                const Mesh mesh = extract(model);
                INFO("pattern " << pattern << ", round " << round);
                REQUIRE(complaint(mesh) == "");
                REQUIRE(measureMesh(mesh).euler ==
                        eulerOfValues([&](const Vec3i& p) { return rawAt(model.field, p); },
                                      cell - Vec3i::Ones(), cell + Vec3i::Constant(2)));
            }
    }
}

TEST_CASE("thousands of random sparse fields: closed, manifold, of the topology that the values have",
          "[export]") {
    std::size_t n_meshes = 0, n_triangles = 0, n_cut = 0, n_filled = 0;
    for (std::uint64_t seed = 0; seed < 4000; ++seed) {
        Dice dice{seed};
        const int kind = static_cast<int>(seed % kKinds);
        const float share_of_cells = dice.unit() < 0.2f ? 1.0f : dice.between(0.02f, 1);
        const float share_of_leaves = dice.between(0.4f, 1), share_inside = dice.between(0.05f, 0.95f);
        // Mostly small fields around a corner of eight leaves; now and then leaves on and off in a larger box.
        const bool is_large = seed % 40 == 7;
        const Vec3i low = Vec3i::Constant(is_large ? 0 : 5), high = Vec3i::Constant(is_large ? 23 : 10);
        std::vector<bool> has_leaf(27);
        for (std::size_t i = 0; i < has_leaf.size(); ++i) has_leaf[i] = dice.unit() < share_of_leaves;
        Model model = modelOf(makeTopology(Vec3i::Constant(24), low, high, [&](const Vec3i& c) {
            const Vec3i leaf = c / kLeafDim;
            return has_leaf[leaf.x() * 9 + leaf.y() * 3 + leaf.z()] && dice.unit() < share_of_cells;
        }));
        if (model.field.topology().voxelCount() == 0) continue;
        setDensity(model.field, [&](const Vec3i& p) { return randomRaw(dice, kind, p, share_inside); });

        const Vec3i first = low - Vec3i::Ones(), end = high + Vec3i::Constant(2);
        const auto raw = [&](const Vec3i& p) { return rawAt(model.field, p); };
        MeshOptions options = kPlain;
        options.fill_inside = seed % 3 == 1;
        std::vector<bool> reached;
        if (options.fill_inside) reached = reachedFromBeyond(raw, first, end);
        VoxelBox bounds{first, end};
        if (seed % 5 == 2) {
            const int n = high.x() - low.x();
            for (int axis = 0; axis < 3; ++axis) {
                bounds.min[axis] = low[axis] + dice.below(n - 1);
                bounds.max[axis] = bounds.min[axis] + 1 + dice.below(n);
            }
            options.bounds = Box{bounds.min.cast<double>(), bounds.max.cast<double>()};
        }
        const auto value = [&](const Vec3i& p) -> float {
            if (!bounds.contains(p)) return -1;
            if (!options.fill_inside) return raw(p);
            const Vec3i n = end - first, q = p - first;
            const bool is_beyond = (q.array() < 0).any() || (q.array() >= n.array()).any();
            if (is_beyond || reached[(static_cast<std::size_t>(q.x()) * n.y() + q.y()) * n.z() + q.z()])
                return raw(p);
            return raw(p) >= 0 ? raw(p) : 1.0f;
        };
        bool has_inside = false, has_field_inside = false;
        for (int x = first.x(); x < end.x(); ++x)
            for (int y = first.y(); y < end.y(); ++y)
                for (int z = first.z(); z < end.z(); ++z) {
                    has_inside |= value(Vec3i(x, y, z)) >= 0;
                    has_field_inside |= raw(Vec3i(x, y, z)) >= 0;
                }
        INFO("seed " << seed);
        if (!has_inside) {
            if (has_field_inside) REQUIRE_THROWS_AS(extract(model, options), NumericError);
            continue;
        }
        const Mesh mesh = extract(model, options);
        REQUIRE(complaint(mesh) == "");
        REQUIRE(measureMesh(mesh).euler == eulerOfValues(value, first, end));
        if (seed % 10 == 7) {
            const ThreadLimit limit(1);
            REQUIRE(sameBytes(mesh, extract(model, options)));
        }
        ++n_meshes;
        n_triangles += mesh.triangles.size();
        n_cut += options.bounds.has_value();
        n_filled += options.fill_inside;
    }
    CHECK(n_meshes > 3500);
    CHECK(n_cut > 500);
    CHECK(n_filled > 1000);
    CHECK(n_triangles > 1000000);
}
