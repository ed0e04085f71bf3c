// SPDX-License-Identifier: Apache-2.0
// Regions of shells whose cells are halved (vdb/shells.h).
#include <cmath>

#include "core/random.h"
#include "tests/support/catch.h"
#include "tests/support/nested_field.h"
#include "vdb/adapt.h"
#include "vdb/ray_tracer.h"

using namespace nerfvdb;

namespace {

const Vec3i kExtent(32, 16, 48);

double unit(int stream, int index) { return unitFloat(static_cast<std::uint32_t>(randomBits(7, stream, index))); }

Vec3d pointIn(const Box& box, int index) {
    Vec3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = box.min[axis] + box.size()[axis] * unit(axis, index);
    return p;
}

/// How often the place's region is halved: the slow way, from the world alone.
int halvingsAt(const VoxelField& field, const Vec3d& p) {
    const Shells& shells = field.shells();
    int shell = shells.count - 1;
    while (shell > 0 && field.shellBox(shell - 1).contains(p)) --shell;
    const Box box = field.shellBox(shell);
    Vec3i region;
    for (int axis = 0; axis < 3; ++axis)
        region[axis] = static_cast<int>((p[axis] - box.min[axis]) / box.size()[axis] * shells.regions->dims[axis]);
    return shells.regions->at(shell, region);
}

/// ln(sigma) at a place, trilinear between the corners of the one cell that holds it; checks that it is one.
double logSigmaAt(const VoxelField& field, const Vec3d& p, int& layer_found) {
    const Shells& shells = field.shells();
    double value = 0;
    int n_found = 0;
    for (int layer = 0; layer < shells.layerCount(); ++layer) {
        const Vec3d index = shells.frame(field.frame(), layer).indexFromWorld(p);
        const Vec3d local = index - shells.corner(layer).cast<double>();
        if ((local.array() < 0).any() || (local.array() >= shells.extentOf(layer).cast<double>().array()).any()) continue;
        const Vec3i cell = index.array().floor().cast<int>();
        const int leaf = field.topology().findLeaf(test::floorLeaf(cell));
        if (leaf < 0 || !testBit(field.topology().cells()[leaf], brickOffset(cell.x() & 7, cell.y() & 7, cell.z() & 7)))
            continue;
        ++n_found;
        layer_found = layer;
        const Vec3d u = index - cell.cast<double>();
        double raw = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3i step(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
            double weight = 1;
            for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? u[axis] : 1 - u[axis];
            raw += weight * test::rawAt(field, cell + step);
        }
        value = raw + std::log(field.densityScale() / shells.layerScale(layer));
    }
    REQUIRE(n_found == 1);
    return value;
}

/// Three shells, of which regions here and there are halved once or twice; smooth values.
VoxelField patchwork() {
    VoxelField field = test::nestedField(kExtent, 3, 4);
    test::setNested(field, [](const Vec3d& p) { return std::sin(2 * p.x()) + 0.7 * p.y() - std::cos(p.z()); });
    const Vec3i dims(4, 2, 3);
    std::vector<std::uint8_t> halvings(static_cast<std::size_t>(3 * dims.prod()));
    for (std::size_t i = 0; i < halvings.size(); ++i)
        halvings[i] = static_cast<std::uint8_t>(randomBits(9, 1, i) % (kMostHalvings + 1));
    return test::halvedField(std::move(field), dims, halvings);
}

}  // namespace

TEST_CASE("each point lies in one cell, of the layer that its region's halvings say, and has the density it had") {
    VoxelField plain = test::nestedField(kExtent, 3, 4);
    test::setNested(plain, [](const Vec3d& p) { return std::sin(2 * p.x()) + 0.7 * p.y() - std::cos(p.z()); });
    const VoxelField field = patchwork();
    CHECK(field.shells().mostHalvings() == 2);
    CHECK(field.shells().fits(field.topology().dims()));
    int n_layers[9] = {};
    double worst = 0;
    for (int i = 0; i < 4000; ++i) {
        const Vec3d p = pointIn(i % 2 ? field.shellBox(0) : field.worldBox(), i);
        int layer = -1, plain_layer = -1;
        const double value = logSigmaAt(field, p, layer);
        CHECK(field.shells().halvingsOf(layer) == halvingsAt(field, p));
        const Vec3d index = field.shells().fromInner(layer, field.frame().indexFromWorld(p));
        CHECK(field.shells().layerAt(static_cast<int>(index.x())) == layer);
        worst = std::max(worst, std::abs(value - logSigmaAt(plain, p, plain_layer)));
        ++n_layers[layer];
    }
    for (const int n : n_layers) CHECK(n > 10);
    // A corner where a region ends may have been there before, in the halved layer beside it, with the same value: no
    // step anywhere. Sums of eight single-precision values near 3.
    CHECK(worst < 3e-6);
}

TEST_CASE("features and moments move with their voxels") {
    const VoxelField before = test::nestedField(kExtent, 2, 4);
    Shells to = before.shells();
    to.regions = makeRegions(2, {4, 2, 6}, std::vector<std::uint8_t>(96, 1));
    REQUIRE(to.regions);
    const Topology halved = halveRegions(before.topology(), before.shells(), to);
    CHECK(halved.cellCount() == 8 * before.topology().cellCount());
    std::vector<float> in(before.topology().leafCount() * kLeafVoxels * 4), out(halved.leafCount() * kLeafVoxels * 4);
    const auto valueAt = [](const Vec3d& p, int c) { return static_cast<float>(p[c % 3] + c); };
    test::forEachNested(before, [&](int, const Vec3d& p, std::size_t i) {
        for (int c = 0; c < 4; ++c) in[i * 4 + c] = valueAt(p, c);
    });
    halveValues(before.topology(), before.shells(), halved, 4, in, out);
    const VoxelField after(halved, before.frame(), to, 4, before.densityScale());
    std::size_t n = 0, wrong = 0;
    test::forEachNested(after, [&](int layer, const Vec3d& p, std::size_t i) {
        CHECK(to.halvingsOf(layer) == 1);
        for (int c = 0; c < 4; ++c) wrong += std::abs(out[i * 4 + c] - valueAt(p, c)) > 1e-5f;
        ++n;
    });
    CHECK(wrong == 0);
    CHECK(n == halved.voxelCount());
}

namespace {

constexpr float kStep = 0.05f;  // voxels

/// Optical depth along a ray from where it is looked from, as traced ...
double tracedDepth(const VoxelField& field, const Occupancy& occupancy, const Ray& ray) {
    const TraceScene scene(field, occupancy);
    TraceOptions options;
    options.step_voxels = kStep, options.stop_transmittance = 0, options.min_weight = 0;
    RayTracer tracer(1);
    KeptSamples kept;
    tracer.addRay(scene, ray, options.step_voxels, 0.5f);
    tracer.trace(scene, options, kept);
    return -std::log(static_cast<double>(tracer.transmittance()[0]));
}

/// ... and summed at midpoints of steps of a tenth of the smallest voxel, a billionth beside the ray: what lies in a face, where
/// roundings decide, is above it then, as a ray has it.
double summedDepth(const VoxelField& field, const Ray& ray) {
    const Box box = field.worldBox();
    const double step = 0.05 / 4 / 10;
    double tau = 0;
    for (double t = 0.5 * step; t < 3 * box.size().norm(); t += step) {
        const Vec3d p = ray.origin + t * ray.direction + Vec3d::Constant(1e-9);
        if (!box.contains(p) || (p.array() >= box.max.array()).any()) continue;
        int layer;
        tau += step * std::exp(logSigmaAt(field, p, layer));
    }
    return tau;
}

// A stretch errs by up to half a step of 1/20 voxel where it ends, of the 30 voxels and more that it is long, most of them
// less; and so does the sum that it is held against.
constexpr double kDepthError = 0.01;
constexpr double kMostDepth = 69;  // light is 1e-30 then

}  // namespace

TEST_CASE("rays lose in a patchwork of regions the light that its density says") {
    const VoxelField field = patchwork();
    const Occupancy occupancy = findOccupied(field, 0);
    const Box box = field.worldBox();
    double worst = 0;
    for (int i = 0; i < 48; ++i) {
        const Vec3d outside = box.center() + 2 * box.size().norm() * Vec3d(unit(4, i) - 0.5, unit(5, i) - 0.5, 1).normalized();
        const Vec3d from = i % 3 ? pointIn(box, 1000 + i) : outside;
        Vec3d direction = (pointIn(field.shellBox(0), 2000 + i) - from).normalized();
        if (i % 8 == 7) direction = Vec3d::Unit(i % 3);
        const double traced = tracedDepth(field, occupancy, {from, direction}), tau = summedDepth(field, {from, direction});
        REQUIRE_FALSE(std::isnan(traced));
        if (tau < kMostDepth) worst = std::max(worst, std::abs(traced - tau) / std::max(tau, 0.1));
    }
    CHECK(worst < kDepthError);
}

TEST_CASE("rays in faces and along edges of regions lose the light that they should, whatever their directions' traces") {
    const VoxelField field = patchwork();
    const Occupancy occupancy = findOccupied(field, 0);
    const Vec3i dims = field.shells().regions->dims;
    constexpr double kTraces[] = {5e-324, -5e-324, -0.0, 6e-17, -6e-17};  // the last are what turning a camera leaves of zero
    double worst = 0;
    int n = 0;
    for (int i = 0; i < 300; ++i) {
        const int shell = i % 3, axis = i / 3 % 3;
        const Box box = field.shellBox(shell);
        const Vec3d width = box.size().cwiseQuotient(dims.cast<double>());
        Vec3d from = pointIn(box, 3000 + i);
        // In a face between regions (one coordinate), or along an edge of them (two), from before, inside or on a corner.
        for (int other = 1; other <= 1 + i % 2; ++other) {
            const int b = (axis + other) % 3;
            from[b] = box.min[b] + width[b] * static_cast<int>((dims[b] + 1) * unit(6, 3 * i + other));
        }
        const int sign = i % 4 < 2 ? 1 : -1;
        from[axis] = sign > 0 ? box.min[axis] : box.max[axis];
        if (i % 5 > 1) from[axis] += sign * 0.3 * unit(7, i) * box.size()[axis];
        if (i % 5 == 0) from[axis] += sign * width[axis];
        if (i % 5 == 1) from[axis] -= sign;
        Vec3d direction = sign * Vec3d::Unit(axis);
        if (i % 7 < 5) direction[(axis + 1) % 3] = kTraces[i % 7];
        if (i % 11 == 0) direction = (Vec3d::Unit(axis) + Vec3d::Unit((axis + 1) % 3)).normalized();
        const double traced = tracedDepth(field, occupancy, {from, direction});
        REQUIRE_FALSE(std::isnan(traced));
        const Box all = field.worldBox();
        const double tau = summedDepth(field, {from, direction});
        // A ray in the outermost upper face may miss.
        if ((from.array() > all.max.array() - 1e-9).any() || tau > kMostDepth) continue;
        worst = std::max(worst, std::abs(traced - tau) / std::max(tau, 0.1));
        ++n;
    }
    CHECK(n > 90);
    CHECK(worst < kDepthError);
}

TEST_CASE("regions that do not fit their shells are none") {
    CHECK(makeRegions(2, {4, 2, 6}, std::vector<std::uint8_t>(96, kMostHalvings)));
    CHECK_FALSE(makeRegions(2, {4, 2, 6}, std::vector<std::uint8_t>(95, 0)));
    CHECK_FALSE(makeRegions(2, {4, 2, 6}, std::vector<std::uint8_t>(96, kMostHalvings + 1)));
    CHECK_FALSE(makeRegions(2, {0, 2, 6}, {}));
    CHECK_FALSE(makeRegions(2, {-4, -2, 6}, std::vector<std::uint8_t>(96, 0)));
    CHECK_FALSE(makeRegions(kMaxShells + 1, {1, 1, 1}, std::vector<std::uint8_t>(kMaxShells + 1, 0)));

    Shells shells = test::nestedShells(kExtent, 2);
    const auto fitsWith = [&](const Vec3i& dims) {
        shells.regions = makeRegions(2, dims, std::vector<std::uint8_t>(static_cast<std::size_t>(2 * dims.prod()), 1));
        return shells.fits(shells.dims());
    };
    CHECK(fitsWith({4, 2, 6}));
    CHECK(fitsWith({1, 1, 1}));
    CHECK(fitsWith({2, 2, 3}));
    CHECK_FALSE(fitsWith({8, 2, 6}));   // half a leaf
    CHECK_FALSE(fitsWith({4, 2, 5}));   // no whole number of leaves
    CHECK_FALSE(fitsWith({3, 2, 6}));

    // Extents that would overflow, and an index space that goes on behind the last layer.
    Shells large = shells;
    large.regions = makeRegions(2, {1, 1, 1}, {2, 0});
    const Vec3i dims = large.dims();
    CHECK(large.fits(dims));
    CHECK_FALSE(large.fits(dims + Vec3i(8, 0, 0)));
    large.extent.y() = 1 << 30;
    CHECK_FALSE(large.fits(dims));
    shells.regions = makeRegions(2, {4, 2, 6}, std::vector<std::uint8_t>(96, 1));
    CHECK_FALSE(shells.fits(test::nestedDims(shells)));  // an index space without room for halved layers
}
