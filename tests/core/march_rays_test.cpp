// SPDX-License-Identifier: Apache-2.0
// Marching must find exactly the samples that a plain walk finds: every step of every ray, one after the other,
// with nothing skipped.
#include <cmath>
#include <limits>
#include <vector>

#include "core/simd/kernels.h"
#include "tests/support/catch.h"
#include "tests/support/random_field.h"
#include "tests/support/targets.h"
#include "vdb/occupancy.h"

using namespace nerfvdb;
using test::randomIn;

namespace {

const Vec3i kDims(40, 32, 48);
/// Rays in index space; each runs from its origin to where it leaves the box.
struct Rays {
    std::vector<float> ox, oy, oz, dx, dy, dz, length, offset;
    std::vector<std::int32_t> next, alive;

    float step = 0.5f;

    void add(const Vec3d& origin, const Vec3d& direction, float first) {
        const Vec3d unit = direction.normalized(), box = (kDims - Vec3i::Ones()).cast<double>();
        double leaves = std::numeric_limits<double>::infinity();
        for (int axis = 0; axis < 3; ++axis)
            if (unit[axis] != 0)
                leaves = std::min(leaves, ((unit[axis] > 0 ? box[axis] : 0.0) - origin[axis]) / unit[axis]);
        for (int axis = 0; axis < 3; ++axis) {
            (axis == 0 ? ox : axis == 1 ? oy : oz).push_back(static_cast<float>(origin[axis]));
            (axis == 0 ? dx : axis == 1 ? dy : dz).push_back(static_cast<float>(unit[axis]));
        }
        length.push_back(static_cast<float>(std::max(leaves, 0.0)));
        offset.push_back(first * step);
        next.push_back(0);
        alive.push_back(static_cast<std::int32_t>(alive.size()));
    }
    std::size_t size() const { return length.size(); }
    /// Parallel to an axis from a whole-numbered origin, in steps of few digits: every coordinate is exact, on faces too.
    bool isExact(std::size_t r) const {
        if (step * 2 != std::round(step * 2)) return false;
        const Vec3f origin(ox[r], oy[r], oz[r]), direction(dx[r], dy[r], dz[r]);
        return origin == Vec3f(origin.array().round()) && direction.cwiseAbs().maxCoeff() == 1;
    }
    RayTile tile(std::vector<std::int32_t>& progress) {
        return {static_cast<int>(size()),
                ox.data(),
                oy.data(),
                oz.data(),
                dx.data(),
                dy.data(),
                dz.data(),
                length.data(),
                offset.data(),
                progress.data()};
    }
};

/// Origins on and in the box, directions of all kinds.
Rays mixedRays(float step = 0.5f) {
    Rays rays;
    rays.step = step;
    const Vec3d box = (kDims - Vec3i::Ones()).cast<double>();
    const auto inBox = [&](std::uint64_t i) {
        Vec3d p;
        for (int axis = 0; axis < 3; ++axis) p[axis] = box[axis] * randomIn(0, 1, 70 + axis, i);
        return p;
    };
    for (int i = 0; i < 60; ++i) {  // in general position, from inside and from a face
        Vec3d origin = inBox(i);
        if (i % 2) origin[i % 3] = i % 4 < 2 ? 0.0 : box[i % 3];
        rays.add(origin, inBox(1000 + i) - origin, randomIn(0, 1, 73, i));
    }
    for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {-1.0, 1.0})
            for (int i = 0; i < 8; ++i) {
                Vec3d direction = Vec3d::Zero(), origin = inBox(2000 + 16 * axis + i);
                direction[axis] = sign;
                if (i < 4) origin[axis] = sign > 0 ? 0.0 : box[axis];
                rays.add(origin, direction, 0.25f);                            // parallel to an axis
                rays.add(origin.array().round(), direction, 0.25f);            // along edges of cells
                rays.add((origin / 8).array().floor() * 8, direction, 0.25f);  // along edges of leaves
                direction[(axis + 1) % 3] = 1e-7;
                rays.add((origin / 8).array().floor() * 8, direction, 0.25f);  // grazing a face of leaves
                direction[(axis + 1) % 3] = 1;
                rays.add(origin.array().round(), direction, 0.25f);  // diagonal in a face, edge to edge
            }
    rays.add(Vec3d::Zero(), Vec3d::Ones(), 0.0f);  // through every corner on the diagonal
    rays.add(box, -Vec3d::Ones(), 0.0f);           // and back
    rays.add(box, Vec3d::Ones(), 0.0f);            // out of the box at once
    return rays;
}

/// What marching found on one ray.
struct Found {
    Vec3d position;  // index space, from leaf, cell and place in the cell
    double t;
};

/// Marches all rays to their ends, in rounds of max_per_ray, and checks what kernels.h promises of each round.
std::vector<std::vector<Found>> march(decltype(&simd::marchRays) kernel, const Topology& topology,
                                      const Bricks& bricks, Rays& rays, int max_per_ray) {
    std::vector<std::vector<Found>> found(rays.size());
    std::vector<std::int32_t> progress = rays.next, alive = rays.alive, begin(rays.size() + 1);
    const std::size_t room = rays.size() * static_cast<std::size_t>(max_per_ray) + kPadding;
    std::vector<std::int32_t> leaf(room), cell(room);
    std::vector<float> x(room), y(room), z(room), t(room);
    int broken = 0;
    while (!alive.empty()) {
        const std::size_t n_alive = alive.size();
        alive.resize(n_alive + kPadding);
        const int n = kernel(bricks, rays.tile(progress), rays.step, max_per_ray, alive.data(),
                             static_cast<int>(n_alive), begin.data(),
                             {leaf.data(), cell.data(), x.data(), y.data(), z.data(), t.data()});
        alive.resize(n_alive);
        broken += begin[n_alive] != n;
        std::vector<std::int32_t> still;
        for (std::size_t a = 0; a < alive.size(); ++a) {
            const std::int32_t r = alive[a], count = begin[a + 1] - begin[a];
            broken += count > max_per_ray;
            for (int i = begin[a]; i < begin[a + 1]; ++i) broken += leaf[i] != leaf[begin[a]];
            for (int i = begin[a]; i < begin[a + 1]; ++i) {
                const Vec3i ijk = topology.leafCoords()[leaf[i]] * kLeafDim +
                                  Vec3i(cell[i] >> 6, cell[i] >> 3 & 7, cell[i] & 7);
                broken += !testBit(topology.cells()[leaf[i]], cell[i]);
                broken += !(x[i] >= 0 && x[i] <= 1 && y[i] >= 0 && y[i] <= 1 && z[i] >= 0 && z[i] <= 1);
                broken += !found[r].empty() && t[i] <= found[r].back().t;
                found[r].push_back({ijk.cast<double>() + Vec3d(x[i], y[i], z[i]), t[i]});
            }
            if (progress[r] >= 0) still.push_back(r);
        }
        alive = still;
    }
    CHECK(broken == 0);
    return found;
}

// Coordinates up to 48 and a handful of roundings of 2^-19 each.
constexpr double kRounding = 2e-5;

bool isNearFace(const Vec3d& p) { return ((p.array() - p.array().round()).abs() < kRounding).any(); }

/// Samples that only one of two walks found, or that both put at different places; a sample within rounding of
/// a cell's face may belong to either side, and so be found by one alone, unless coordinates are exact.
int countDifferent(const std::vector<Found>& a, const std::vector<Found>& b, bool is_exact, float step) {
    int different = 0;
    std::size_t i = 0, j = 0;
    while (i < a.size() || j < b.size()) {
        if (i < a.size() && j < b.size() && std::abs(a[i].t - b[j].t) < 0.25 * step) {
            different += (a[i++].position - b[j++].position).cwiseAbs().maxCoeff() > kRounding;
        } else if (j == b.size() || (i < a.size() && a[i].t < b[j].t)) {
            different += !isNearFace(a[i++].position) || is_exact;
        } else {
            different += !isNearFace(b[j++].position) || is_exact;
        }
    }
    return different;
}

}  // namespace

TEST_CASE("marching finds exactly the samples of a plain walk, for any occupancy, direction and round length") {
    const float step = GENERATE(0.5f, 0.05f, 0.3f, 4.0f);
    Rays rays = mixedRays(step);
    for (const double share : {0.001, 0.02, 0.3, 1.0}) {
        const VoxelField field = test::randomField(kDims, 4, share, -1.0f, 1.0f, 80);
        const Topology& topology = field.topology();
        const Occupancy occupancy =
            occupancyFromCells(topology, {topology.cells().begin(), topology.cells().end()});
        const Bricks bricks = bricksOf(field, occupancy);
        const auto expected = march(&reference::marchRays, topology, bricks, rays, 10000);
        std::size_t n_expected = 0;
        for (const auto& ray : expected) n_expected += ray.size();
        REQUIRE(static_cast<double>(n_expected) > (share > 0.01 ? 50 / step : 0));

        test::forEachTarget([&] {
            for (const int max_per_ray : {1, 8, 1000}) {
                CAPTURE(step, share, max_per_ray);
                const auto found = march(&simd::marchRays, topology, bricks, rays, max_per_ray);
                int different = 0;
                for (std::size_t r = 0; r < rays.size(); ++r)
                    different += countDifferent(expected[r], found[r], rays.isExact(r), step);
                CHECK(different == 0);
            }
        });
    }
}

TEST_CASE("marching through nothing ends every ray without a sample") {
    const VoxelField field(Topology(kDims, {}), {}, 4, 1.0);
    const Occupancy occupancy = occupancyFromCells(field.topology(), {});
    const Bricks bricks = bricksOf(field, occupancy);
    Rays rays = mixedRays();
    test::forEachTarget([&] {
        for (const auto& ray : march(&simd::marchRays, field.topology(), bricks, rays, 8)) CHECK(ray.empty());
    });
}
