// SPDX-License-Identifier: Apache-2.0
// Light along a ray against its exact integral, with the order of convergence that theory gives: where a step's
// weights are exact, samples in the middle of steps are of second order; where matter ends inside a step, of
// first.
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/grid_field.h"
#include "tests/support/random_field.h"
#include "vdb/ray_tracer.h"

using namespace nerfvdb;

namespace {

constexpr double kVoxel = 0.1;                                 // world units
constexpr double kScale = 10;                                  // density scale: sigma per voxel is exp(raw)
constexpr int kFirst = 8, kEnd = 24, kLength = kEnd - kFirst;  // the slab, voxels along x
const Vec3d kOrigin(-1, 2, 3);

/// Cells first <= x < end of a box of 40 x 16 x 16 voxels; values are functions of x. The first feature channel
/// is `feature`, the others are zero.
VoxelField layered(int first, int end, const std::function<double(int)>& raw,
                   const std::function<double(int)>& feature) {
    const Topology topology = test::makeTopology(Vec3i(40, 16, 16), Vec3i::Zero(), Vec3i(39, 15, 15),
                                                 [&](const Vec3i& c) { return c.x() >= first && c.x() < end; });
    VoxelField field(topology, {kOrigin, kVoxel}, 4, kScale);
    test::forEachVoxel(field.topology(), [&](const Vec3i& ijk, std::size_t i) {
        field.density()[i] = static_cast<float>(raw(ijk.x()));
        field.features()[4 * i] = static_cast<float>(feature(ijk.x()));
    });
    return field;
}

struct Traced {
    double depth, feature, transmittance;  // optical depth, W F[0], T_end
    double kept;                           // sum of the kept weights
    int n_kept;
};

Traced traceRay(const VoxelField& field, const Ray& ray, double step, double jitter, TraceOptions options) {
    const Occupancy occupancy = occupancyFromCells(
        field.topology(), {field.topology().cells().begin(), field.topology().cells().end()});
    const TraceScene scene(field, occupancy);
    options.step_voxels = static_cast<float>(step);
    RayTracer tracer(1);
    tracer.addRay(scene, ray, options.step_voxels, static_cast<float>(jitter));
    KeptSamples kept;
    tracer.trace(scene, options, kept);
    Traced result{-std::log(tracer.transmittance()[0]), 0, tracer.transmittance()[0], 0, kept.n};
    for (int i = 0; i < kept.n; ++i) result.kept += kept.weight[i];
    result.feature = result.kept * tracer.rayFeatures()[0];
    return result;
}

/// Nothing is dropped and no ray stops early.
TraceOptions exact() {
    TraceOptions options;
    options.stop_transmittance = 0;
    options.min_weight = 0;
    return options;
}

/// From outside the box along +x, through the middle of cells.
Ray alongX() { return {kOrigin + kVoxel * Vec3d(-30, 7.3, 6.6), Vec3d::UnitX()}; }

/// Order at which errors fall from one step length to the next.
double order(double error, double step, double next_error, double next_step) {
    return std::log(error / next_error) / std::log(step / next_step);
}

}  // namespace

TEST_CASE("a constant slab is exact to rounding at any step that divides it, wherever the samples lie") {
    const double sigma = 0.2;
    const VoxelField field = layered(
        kFirst, kEnd, [&](int) { return std::log(sigma); }, [](int) { return 0.5; });
    for (const double step : {2.0, 1.0, 0.5, 0.25})
        for (const double jitter : {0.03, 0.5, 0.97}) {
            CAPTURE(step, jitter);
            const Traced ray = traceRay(field, alongX(), step, jitter, exact());
            // 64 factors, each rounded to 6e-8.
            CHECK(ray.depth == Approx(sigma * kLength).epsilon(1e-5));
            CHECK(ray.feature == Approx(-std::expm1(-sigma * kLength) * 0.5).epsilon(1e-5));
        }
}

TEST_CASE("a slab that ends inside a step is of first order in that step") {
    const double sigma = 0.2;
    const VoxelField field = layered(
        kFirst, kEnd, [&](int) { return std::log(sigma); }, [](int) { return 0.5; });
    double last_error = 0, last_step = 0;
    for (const int n : {4, 8, 16, 32, 64}) {
        // The slab is n + 0.3 steps long, so n or n + 1 samples fall into it: 0.3 too few or 0.7 too many.
        const double step = kLength / (n + 0.3);
        double worst = 0;
        for (int i = 0; i < 40; ++i)
            worst = std::max(worst, std::abs(traceRay(field, alongX(), step, (i + 0.5) / 40, exact()).depth -
                                             sigma * kLength));
        CHECK(worst == Approx(0.7 * step * sigma).epsilon(1e-3));  // rounding, 1e-5 of a depth 60 times larger
        if (last_step > 0) CHECK(order(last_error, last_step, worst, step) == Approx(1).margin(0.01));
        last_error = worst, last_step = step;
    }
}

TEST_CASE("a colour ramp in constant density is of second order in the step") {
    const double sigma = 0.2, slope = 1.0 / 16;
    const VoxelField field = layered(
        kFirst, kEnd, [&](int) { return std::log(sigma); }, [&](int x) { return slope * (x - kFirst); });
    // Integral of sigma exp(-sigma t) slope t dt.
    const double opacity = -std::expm1(-sigma * kLength);
    const double expected = slope * (opacity / sigma - kLength * std::exp(-sigma * kLength));
    double last_error = 0, last_step = 0;
    for (const double step : {2.0, 1.0, 0.5, 0.25}) {
        const double error = traceRay(field, alongX(), step, 0.5, exact()).feature - expected;
        // Light of a step comes from sigma step^2 / 12 before its middle; next order (sigma step)^2 / 60: 0.3
        // %. Rounding, 1e-6 of F, is 2 % of the smallest error.
        CHECK(error == Approx(slope * sigma * step * step / 12 * opacity).epsilon(0.03));
        if (last_step > 0) CHECK(order(last_error, last_step, error, step) == Approx(2).margin(0.05));
        last_error = error, last_step = step;
    }
}

TEST_CASE("a blob cut by the ray's end is of first order in the cut step") {
    // exp(-x^2 / 2 width^2), its middle on the box's far face (voxel 39), features rising across it.
    const double width = 9, end = 39;
    const auto raw = [&](double x) { return std::log(0.15) - 0.5 * (x - end) * (x - end) / (width * width); };
    const VoxelField field = layered(0, 39, raw, [](int x) { return x / 39.0; });
    // The grid is linear between voxels; a double sum over it with 3900 midpoints is good to 1e-8.
    double expected_depth = 0, expected_feature = 0;
    constexpr int kFine = 3900;
    for (int i = 0; i < kFine; ++i) {
        const double x = (i + 0.5) * end / kFine, f = x - std::floor(x);
        const double tau = std::exp((1 - f) * raw(std::floor(x)) + f * raw(std::floor(x) + 1)) * end / kFine;
        expected_feature += std::exp(-expected_depth) * -std::expm1(-tau) * x / 39;
        expected_depth += tau;
    }
    double last[2] = {0, 0}, last_step = 0;
    for (const int n : {13, 26, 52, 104, 208}) {
        // The last 0.3 steps hold no sample: their depth, the density at the end, and their light are lost.
        const double step = end / (n + 0.3);
        const Traced ray = traceRay(field, alongX(), step, 0.5, exact());
        const double lost[2] = {expected_depth - ray.depth, expected_feature - ray.feature};
        // Beyond the cut there are second-order terms, 10 % at the longest step and falling with it.
        CHECK(lost[0] == Approx(0.3 * step * 0.15).epsilon(0.03 * step + 1e-3));
        if (last_step > 0)
            for (int k = 0; k < 2; ++k)
                CHECK(order(last[k], last_step, lost[k], step) == Approx(1).margin(0.1));
        last[0] = lost[0], last[1] = lost[1], last_step = step;
    }
}

TEST_CASE("rays that start inside, or run along a face, see what lies before them") {
    const double sigma = 0.2;
    const VoxelField field = layered(
        kFirst, kEnd, [&](int) { return std::log(sigma); }, [](int) { return 0.5; });
    const auto depthFrom = [&](const Vec3d& index, const Vec3d& direction) {
        return traceRay(field, {kOrigin + kVoxel * index, direction}, 0.5, 0.5, exact()).depth;
    };
    const double whole = sigma * kLength, tolerance = 1e-5 * whole;
    CHECK(depthFrom({10, 7.3, 6.6}, Vec3d::UnitX()) == Approx(sigma * 14).margin(tolerance));
    CHECK(depthFrom({10, 7.3, 6.6}, -Vec3d::UnitX()) == Approx(sigma * 2).margin(tolerance));
    CHECK(depthFrom({30, 7.3, 6.6}, Vec3d::UnitX()) == 0);
    CHECK(depthFrom({30, 7.3, 6.6}, -Vec3d::UnitX()) == Approx(whole).margin(tolerance));
    // Along a face between leaves, and along an edge between four.
    CHECK(depthFrom({-5, 8, 6.6}, Vec3d::UnitX()) == Approx(whole).margin(tolerance));
    CHECK(depthFrom({-5, 8, 8}, Vec3d::UnitX()) == Approx(whole).margin(tolerance));
    CHECK(depthFrom({8, -5, 6.6}, Vec3d::UnitY()) == Approx(sigma * 15).margin(tolerance));
    CHECK(depthFrom({16, -5, 8}, Vec3d::UnitY()) == Approx(sigma * 15).margin(tolerance));
    // Beside the box there is nothing, whatever the direction.
    CHECK(depthFrom({-5, 15.5, 6.6}, Vec3d::UnitX()) == 0);
    CHECK(depthFrom({16, 7, 20}, Vec3d(1, 0.2, 0.1).normalized()) == 0);
}

TEST_CASE("rays of NaN or without direction hit nothing") {
    const VoxelField field = layered(
        kFirst, kEnd, [](int) { return 0.0; }, [](int) { return 0.5; });
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const Ray& ray : {Ray{Vec3d(nan, 0, 0), Vec3d::UnitX()}, Ray{Vec3d::Zero(), Vec3d::Constant(nan)},
                           Ray{kOrigin + Vec3d::Constant(0.5), Vec3d::Zero()}}) {
        const Traced traced = traceRay(field, ray, 0.5, 0.5, exact());
        CHECK(traced.transmittance == 1);
        CHECK(traced.feature == 0);
    }
}

TEST_CASE("stopping early changes colour by no more than the light that was left") {
    // Features between -1 and 1 everywhere.
    const VoxelField field = test::randomField(Vec3i(40, 32, 32), 4, 0.9, -4.0f, 1.0f, 12);
    const Box box = field.worldBox();
    int n_stopped = 0;
    for (int i = 0; i < 60; ++i) {
        const Vec3d target = box.center() + Vec3d(test::randomIn(-1, 1, 1, i), test::randomIn(-1, 1, 2, i), 0);
        const Vec3d eye(-4, test::randomIn(-3, 3, 3, i), 6);
        const Ray ray{eye, (target - eye).normalized()};
        const Traced full = traceRay(field, ray, 0.5, 0.5, exact());
        for (const float stop : {1e-4f, 1e-2f, 0.2f}) {
            TraceOptions options = exact();
            options.stop_transmittance = stop;
            const Traced stopped = traceRay(field, ray, 0.5, 0.5, options);
            CHECK(std::abs(stopped.feature - full.feature) <= stop + 1e-6);  // rounding
            CHECK(std::abs(stopped.transmittance - full.transmittance) <= stop);
            n_stopped += stopped.n_kept < full.n_kept;
        }
    }
    CHECK(n_stopped > 60);  // or nothing was tested
}

TEST_CASE("what is dropped on a ray never exceeds its allowance, in fog of any density") {
    int n_dropping = 0;
    for (const double sigma : {1e-4, 1e-3, 1e-2, 0.1, 1.0})
        for (const float max_dropped : {0.0f, 0.01f, 0.1f})
            for (const float min_weight : {1e-3f, 0.05f, 1.0f}) {
                CAPTURE(sigma, max_dropped, min_weight);
                TraceOptions options = exact();
                options.min_weight = min_weight;
                options.max_dropped = max_dropped;
                const VoxelField field = layered(
                    0, 39, [&](int) { return std::log(sigma); }, [](int) { return 1.0; });
                const Traced ray = traceRay(field, alongX(), 0.5, 0.5, options);
                const Traced full = traceRay(field, alongX(), 0.5, 0.5, exact());
                const double dropped = full.kept - ray.kept;
                CHECK(ray.transmittance == full.transmittance);  // opacity counts all of them
                CHECK(dropped <= max_dropped + 1e-6);            // sums of 78 weights
                CHECK(full.feature - ray.feature <= max_dropped + 1e-6);
                n_dropping += ray.n_kept < full.n_kept;
            }
    CHECK(n_dropping > 15);  // or nothing was tested
}
